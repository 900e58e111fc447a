import { IconAlertTriangle } from "@tabler/icons-react";
import type { VehicleCheck } from "../../api/types";
import classes from "./Fly.module.css";

/** Failed preflight checks; renders nothing if all passed. */
export function PreflightChecks({ checks }: { checks: readonly VehicleCheck[] }) {
  const failed = checks.filter(({ passed }) => !passed);
  if (failed.length === 0) return null;
  return (
    <ul className={classes["checks"]} aria-label="Failed preflight checks">
      {failed.map(({ name, title, found, needed, hint }) => (
        <li key={name}>
          <IconAlertTriangle size={18} aria-hidden />
          <span>
            <strong>{title}</strong>: {found}, required {needed}.{hint && ` ${hint}`}
          </span>
        </li>
      ))}
    </ul>
  );
}
