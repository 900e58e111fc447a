import { IconAlertTriangle, IconCheck, IconCircle, IconProgress } from "@tabler/icons-react";
import type { StateWords, Tone } from "../lib/states";
import classes from "./StateBadge.module.css";

const ICONS = { quiet: IconCircle, good: IconCheck, busy: IconProgress, bad: IconAlertTriangle } satisfies Record<
  Tone,
  typeof IconCheck
>;

export function StateBadge({ words: { word, tone } }: { words: StateWords }) {
  const Icon = ICONS[tone];
  return (
    <span className={classes["state"]} data-tone={tone}>
      <Icon size={15} stroke={2.2} aria-hidden />
      {word}
    </span>
  );
}
