import { Text } from "@mantine/core";
import {
  IconAlertTriangle,
  IconCheck,
  IconCircle,
  IconDeviceDesktop,
  IconDrone,
  IconProgress,
} from "@tabler/icons-react";
import classes from "./Badges.module.css";
import type { StateLabel, Tone } from "./states";

const ICONS = { quiet: IconCircle, good: IconCheck, busy: IconProgress, bad: IconAlertTriangle } satisfies Record<
  Tone,
  typeof IconCheck
>;

export function StateBadge({ words: { word, tone } }: { words: StateLabel }) {
  const Icon = ICONS[tone];
  return (
    <span className={classes["state"]} data-tone={tone}>
      <Icon size={15} stroke={2.2} aria-hidden />
      {word}
    </span>
  );
}

interface Props {
  isReal: boolean;
  title?: string;
}

/** SIM is blue, REAL is hatched orange; both also differ in text and icon. */
export function VehicleBadge({ isReal, title }: Props) {
  const Icon = isReal ? IconDrone : IconDeviceDesktop;
  return (
    <span className={classes["badge"]} data-real={isReal || undefined}>
      <Icon size={16} aria-hidden />
      <strong>{isReal ? "REAL" : "SIM"}</strong>
      {title && (
        <Text span inherit truncate>
          {title}
        </Text>
      )}
    </span>
  );
}
