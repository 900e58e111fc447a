/** The columns of the table of flights. */

import type { Trial } from "../../../api/types";
import { StateBadge } from "../../../ui/Badges";
import { gainText, NOTHING, withUnit } from "../../../ui/format";
import type { Column } from "../../../ui/ListTable";
import { trialStateLabel } from "../../../ui/states";
import { hasStepResponse, MEASURES, measureText } from "../../../ui/stepResponse";
import { Time } from "../../../ui/Time";
import { rangeText } from "../../../ui/uncertainty";
import { CHOICES } from "../proposal/choices";
import { sentenceOf } from "../verdict/verdict";
import { FlightMarkers, PredictionResult } from "./FlightMarkers";
import classes from "./FlightsPanel.module.css";

export interface FlightColumn extends Column<Trial> {
  id: string;
  /** Hidden until it is chosen. */
  extra?: boolean;
}

const KINDS: Record<Trial["kind"], string> = {
  start: "Start",
  step: CHOICES.step.label,
  "shorter step": CHOICES["smaller step"].label,
  repeat: CHOICES.repeat.label,
  baseline: CHOICES.baseline.label,
  manual: CHOICES.own.label,
};

/** The columns after the flight number, from the left: gains and results as in the paper's Table 1. */
export function flightColumns(
  trials: readonly Trial[],
  gainTitles: Readonly<Record<string, string>>,
  unit: string,
): readonly FlightColumn[] {
  const gains = Object.keys(trials[0]?.gains ?? {}).map((name) => ({
    id: name,
    title: name,
    detail: gainTitles[name] ?? "",
    value: ({ gains: own }: Trial) => own[name] ?? null,
    cell: ({ gains: own }: Trial) => <span title={String(own[name] ?? "")}>{gainText(own[name] ?? Number.NaN)}</span>,
  }));
  const measures = (trials.some(hasStepResponse) ? MEASURES : []).map((measure) => ({
    id: measure.name,
    title: measure.title,
    topic: measure.topic,
    value: (trial: Trial) => trial[measure.name],
    cell: (trial: Trial) => measureText(trial, measure),
  }));
  return [
    ...gains,
    {
      id: "error",
      title: "Error",
      topic: "error",
      className: classes["error"],
      value: ({ error }) => error,
      cell: ({ error }) => withUnit(error, unit),
    },
    {
      id: "predicted",
      title: "Predicted",
      topic: "interval",
      value: ({ predicted_error }) => predicted_error,
      cell: (trial) => (
        <>
          {withUnit(trial.predicted_error, unit)} <PredictionResult trial={trial} brief />
          {trial.predicted_interval && <small>{rangeText(trial.predicted_interval, unit)}</small>}
        </>
      ),
    },
    {
      id: "state",
      title: "State",
      isText: true,
      value: ({ state }) => trialStateLabel(state).word,
      cell: (trial) => (
        <>
          <StateBadge words={trialStateLabel(trial.state)} /> <FlightMarkers trial={trial} />
        </>
      ),
    },
    ...measures,
    {
      id: "flown",
      title: "Flown",
      isText: true,
      extra: true,
      value: ({ flown_at }) => flown_at,
      cell: ({ flown_at }) => <Time at={flown_at} />,
    },
    {
      id: "kind",
      title: "Kind",
      isText: true,
      extra: true,
      value: ({ kind }) => KINDS[kind],
      cell: ({ kind }) => KINDS[kind],
    },
    {
      id: "verdict",
      title: "Verdict",
      isText: true,
      className: classes["verdict"],
      value: (trial) => sentenceOf(trial) || null,
      cell: (trial) => sentenceOf(trial) || NOTHING,
    },
  ];
}
