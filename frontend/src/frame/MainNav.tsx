import { UnstyledButton } from "@mantine/core";
import { IconChevronDown, IconMenu2 } from "@tabler/icons-react";
import { useRef } from "react";
import { NavLink, useLocation } from "react-router";
import classes from "./MainNav.module.css";

/** Pages with `inRow` are in the row on wide screens. The menu has all pages on small screens, else the rest. */
const PAGES = [
  { to: "/", title: "Campaigns", inRow: true },
  { to: "/vehicles", title: "Vehicles", inRow: true },
  { to: "/compare", title: "Compare", inRow: false },
  { to: "/reproductions", title: "Reproductions", inRow: false },
  { to: "/log-analysis", title: "Log analysis", inRow: false },
  { to: "/jobs", title: "Jobs", inRow: false },
  { to: "/settings", title: "Settings", inRow: false },
] as const;

interface PageLinkProps {
  to: string;
  title: string;
  onClick?: () => void;
}

function PageLink({ to, title, onClick }: PageLinkProps) {
  return (
    <NavLink to={to} end className={classes["link"] ?? ""} onClick={onClick}>
      {title}
    </NavLink>
  );
}

/** Main navigation: the main pages in a row, the rest in a menu; all in the menu on small screens and in flight. */
export function MainNav() {
  const { pathname } = useLocation();
  const menu = useRef<HTMLUListElement>(null);
  const inMenu = PAGES.some(({ to, inRow }) => to === pathname && !inRow);
  return (
    <nav aria-label="Pages" className={classes["nav"]}>
      <ul className={classes["row"]}>
        {PAGES.filter(({ inRow }) => inRow).map((page) => (
          <li key={page.to}>
            <PageLink {...page} />
          </li>
        ))}
      </ul>
      <UnstyledButton
        className={classes["more"] ?? ""}
        data-here={inMenu || undefined}
        aria-label="More pages"
        title="More pages"
        popoverTarget="pages"
      >
        <span className={classes["word"]}>More</span>
        <IconChevronDown size={18} aria-hidden className={classes["word"]} />
        <IconMenu2 size={22} aria-hidden className={classes["icon"]} />
      </UnstyledButton>
      <ul id="pages" popover="auto" ref={menu} className={classes["menu"]}>
        {PAGES.map((page) => (
          <li key={page.to} data-in-row={page.inRow || undefined}>
            <PageLink {...page} onClick={() => menu.current?.hidePopover()} />
          </li>
        ))}
      </ul>
    </nav>
  );
}
