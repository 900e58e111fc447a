import { Group } from "@mantine/core";
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

/** Whether the error is inside its predicted interval. */
export function PredictionResult({ trial, brief = false }: { trial: Trial; brief?: boolean }) {
  const result = predictionResult(trial);
  if (result === null) return null;
  const Icon = ICONS[result];
  const label = `${result} the predicted interval`;
  return (
    <Group
      component="span"
      display="inline-flex"
      gap={3}
      wrap="nowrap"
      c={result === "inside" ? "var(--best)" : "var(--warn)"}
      fz="fine"
      fw={550}
      title={brief ? label : ""}
    >
      <Icon size={15} aria-label={label} aria-hidden={!brief} />
      {!brief && label}
    </Group>
  );
}
