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

const RESULTS = {
  inside: { Icon: IconCircleCheck, label: "inside the predicted interval", color: "var(--best)" },
  above: { Icon: IconCircleArrowUp, label: "above the predicted interval", color: "var(--warn)" },
  below: { Icon: IconCircleArrowDown, label: "below the predicted interval", color: "var(--warn)" },
} as const;

/** Whether the error is inside its predicted interval. */
export function PredictionResult({ trial, brief = false }: { trial: Trial; brief?: boolean }) {
  const result = predictionResult(trial);
  if (result === null) return null;
  const { Icon, label, color } = RESULTS[result];
  return (
    <Group
      component="span"
      display="inline-flex"
      gap={3}
      wrap="nowrap"
      c={color}
      fz="fine"
      fw={550}
      title={brief ? label : ""}
    >
      <Icon size={15} aria-label={label} aria-hidden={!brief} />
      {!brief && label}
    </Group>
  );
}
