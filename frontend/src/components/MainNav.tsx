import { ActionIcon, Menu } from "@mantine/core";
import { IconMenu2 } from "@tabler/icons-react";
import { Link, NavLink, useLocation } from "react-router";
import classes from "./MainNav.module.css";

const PAGES = [
  { to: "/", title: "Campaigns" },
  { to: "/vehicles", title: "Vehicles" },
  { to: "/reproductions", title: "Reproductions" },
  { to: "/jobs", title: "Jobs" },
] as const;

/** The pages: in a row where there is room, in a menu on a small screen and while something flies. */
export function MainNav() {
  const { pathname } = useLocation();
  return (
    <nav aria-label="Pages" className={classes["nav"]}>
      <ul className={classes["row"]}>
        {PAGES.map(({ to, title }) => (
          <li key={to}>
            <NavLink to={to} end className={classes["link"] ?? ""}>
              {title}
            </NavLink>
          </li>
        ))}
      </ul>
      <Menu position="bottom-start" withinPortal={false}>
        <Menu.Target>
          <ActionIcon color="gray" aria-label="Pages" title="Pages" className={classes["menu"] ?? ""}>
            <IconMenu2 size={22} color="var(--ink)" />
          </ActionIcon>
        </Menu.Target>
        <Menu.Dropdown>
          {PAGES.map(({ to, title }) => (
            <Menu.Item
              key={to}
              component={Link}
              to={to}
              className={classes["item"] ?? ""}
              data-here={pathname === to || undefined}
            >
              {title}
            </Menu.Item>
          ))}
        </Menu.Dropdown>
      </Menu>
    </nav>
  );
}
