import { IconAlertTriangle, IconCheck, IconCircle, IconProgress } from "@tabler/icons-react";
import classes from "./StateBadge.module.css";
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
