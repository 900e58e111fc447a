import { IconAlertTriangle, IconCircleArrowDown, IconCircleArrowUp, IconCircleCheck } from "@tabler/icons-react";
import type { Trial } from "../../../api/types";
import { marksOf, predictionResult } from "../verdict/verdict";
import classes from "./FlightMarkers.module.css";

/** Markers of special flights: refused gains that were flown, glitches in the record. */
export function FlightMarkers({ trial }: { trial: Trial }) {
  return marksOf(trial).map((mark) => (
    <span key={mark} className={classes["mark"]} title={trial.overrule_reason || undefined}>
      <IconAlertTriangle size={15} aria-hidden />
      {mark}
    </span>
  ));
}

const ICONS = { inside: IconCircleCheck, above: IconCircleArrowUp, below: IconCircleArrowDown } as const;
const PREDICTION_LABELS = {
  inside: "inside the predicted interval",
  above: "above the predicted interval",
  below: "below the predicted interval",
} as const;

/** Whether the error is inside its predicted interval. */
export function PredictionResult({ trial, brief = false }: { trial: Trial; brief?: boolean }) {
  const kept = predictionResult(trial);
  if (kept === null) return null;
  const Icon = ICONS[kept];
  return (
    <small className={classes["kept"]} data-kept={kept} title={brief ? PREDICTION_LABELS[kept] : undefined}>
      <Icon size={15} {...(brief ? { "aria-label": PREDICTION_LABELS[kept] } : { "aria-hidden": true })} />
      {!brief && PREDICTION_LABELS[kept]}
    </small>
  );
}
