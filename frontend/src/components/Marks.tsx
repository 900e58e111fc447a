import { IconAlertTriangle, IconCircleArrowDown, IconCircleArrowUp, IconCircleCheck } from "@tabler/icons-react";
import type { Trial } from "../api/types";
import { keptPrediction, marksOf } from "../lib/verdict";
import classes from "./Marks.module.css";

/** What sets a flight apart: refused gains that were flown all the same, a record with glitches. */
export function Marks({ trial }: { trial: Trial }) {
  return marksOf(trial).map((mark) => (
    <span key={mark} className={classes["mark"]} title={trial.overrule_reason || undefined}>
      <IconAlertTriangle size={15} aria-hidden />
      {mark}
    </span>
  ));
}

const ICONS = { inside: IconCircleCheck, above: IconCircleArrowUp, below: IconCircleArrowDown } as const;
const WORDS = { inside: "inside the interval", above: "above the interval", below: "below the interval" } as const;

/** Whether the flight ended where it was predicted to. */
export function Kept({ trial, brief = false }: { trial: Trial; brief?: boolean }) {
  const kept = keptPrediction(trial);
  if (kept === null) return null;
  const Icon = ICONS[kept];
  return (
    <small className={classes["kept"]} data-kept={kept} title={brief ? WORDS[kept] : undefined}>
      <Icon size={15} {...(brief ? { "aria-label": WORDS[kept] } : { "aria-hidden": true })} />
      {!brief && WORDS[kept]}
    </small>
  );
}
