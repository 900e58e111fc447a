import { IconDeviceDesktop, IconDrone } from "@tabler/icons-react";
import classes from "./VehicleBadge.module.css";

interface Props {
  isReal: boolean;
  title?: string | undefined;
}

/** SIM is blue, REAL is hatched orange; both also differ in text and icon. */
export function VehicleBadge({ isReal, title }: Props) {
  const Icon = isReal ? IconDrone : IconDeviceDesktop;
  return (
    <span className={classes["badge"]} data-real={isReal || undefined}>
      <Icon size={16} aria-hidden />
      <strong>{isReal ? "REAL" : "SIM"}</strong>
      {title && <span className={classes["title"]}>{title}</span>}
    </span>
  );
}
