import { Group } from "@mantine/core";
import { IconAlertTriangle, IconCircleArrowDown, IconCircleArrowUp, IconCircleCheck } from "@tabler/icons-react";
import type { Trial } from "../../../api/types";
import { marksOf, predictionResult } from "../verdict/verdict";

/** An icon with a few words. */
const IN_LINE = { display: "inline-flex", gap: 4, wrap: "nowrap", fz: "fine", className: "quantity" } as const;

/** Markers of special flights: refused gains that were flown, glitches in the record. */
export function FlightMarkers({ trial }: { trial: Trial }) {
  return marksOf(trial).map((mark) => (
    <Group
      key={mark}
      component="span"
      {...IN_LINE}
      px={8}
      py={1}
      bd="1px solid var(--warn)"
      bdrs={999}
      bg="var(--warn-soft)"
      c="var(--warn)"
      fw={650}
      title={trial.overrule_reason}
    >
      <IconAlertTriangle size={15} aria-hidden />
      {mark}
    </Group>
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
      {...IN_LINE}
      c={result === "inside" ? "var(--best)" : "var(--warn)"}
      fw={550}
      title={brief ? label : ""}
    >
      <Icon size={15} aria-label={label} aria-hidden={!brief} />
      {!brief && label}
    </Group>
  );
}
