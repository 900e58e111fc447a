import { Box, Group, UnstyledButton } from "@mantine/core";
import { IconChevronDown, IconMenu2 } from "@tabler/icons-react";
import { useRef } from "react";
import { Link, useLocation } from "wouter";
import classes from "./MainNav.module.css";

/** Pages with `inRow` are in the row on wide screens. The menu has all pages on small screens, else the rest. */
const PAGES = [
  { to: "/", title: "Campaigns", inRow: true },
  { to: "/log-analysis", title: "Log analysis", inRow: true },
  { to: "/vehicles", title: "Vehicles", inRow: true },
  { to: "/compare", title: "Compare", inRow: false },
  { to: "/reproductions", title: "Reproductions", inRow: false },
  { to: "/jobs", title: "Jobs", inRow: false },
  { to: "/settings", title: "Settings", inRow: false },
] as const;

interface PageLinkProps {
  to: string;
  title: string;
  onClick?: () => void;
}

function PageLink({ to, title, onClick }: PageLinkProps) {
  const isHere = useLocation()[0] === to;
  return (
    <Link to={to} className={classes["link"]} aria-current={isHere ? "page" : undefined} onClick={onClick}>
      {title}
    </Link>
  );
}

/** Main navigation: the main pages in a row, the rest in a menu; all in the menu on small screens, in flight also on
 * larger ones. A phone has no room for it in flight. */
export function MainNav({ isInFlight }: { isInFlight: boolean }) {
  const [pathname] = useLocation();
  const menu = useRef<HTMLUListElement>(null);
  const inMenu = PAGES.some(({ to, inRow }) => to === pathname && !inRow);
  const rowFrom = isInFlight ? "lg" : "sm";
  return (
    <Group
      component="nav"
      flex="none"
      gap={2}
      wrap="nowrap"
      aria-label="Pages"
      visibleFrom={isInFlight ? "xs" : undefined}
    >
      <Group component="ul" gap={2} wrap="nowrap" visibleFrom={rowFrom}>
        {PAGES.filter(({ inRow }) => inRow).map((page) => (
          <li key={page.to}>
            <PageLink {...page} />
          </li>
        ))}
      </Group>
      <UnstyledButton
        className={classes["link"] ?? ""}
        data-here={inMenu || undefined}
        aria-label="More pages"
        title="More pages"
        popoverTarget="pages"
      >
        <Group gap={4} visibleFrom={rowFrom}>
          More
          <IconChevronDown size={18} aria-hidden />
        </Group>
        <Box hiddenFrom={rowFrom} c="var(--ink)" lh={0}>
          <IconMenu2 size={22} aria-hidden />
        </Box>
      </UnstyledButton>
      <ul id="pages" popover="auto" ref={menu} className={classes["menu"]}>
        {PAGES.map((page) => (
          <Box component="li" key={page.to} hiddenFrom={page.inRow ? rowFrom : undefined}>
            <PageLink {...page} onClick={() => menu.current?.hidePopover()} />
          </Box>
        ))}
      </ul>
    </Group>
  );
}
