/** The columns of the table of flights. */

import type { ReactNode } from "react";
import type { Trial } from "../../../api/types";
import { StateBadge } from "../../../ui/Badges";
import type { Topic } from "../../../ui/explanations";
import { gainText, NOTHING, withUnit } from "../../../ui/format";
import { trialStateLabel } from "../../../ui/states";
import { hasStepResponse, MEASURES, measureText } from "../../../ui/stepResponse";
import { Time } from "../../../ui/Time";
import { rangeText } from "../../../ui/uncertainty";
import { CHOICES } from "../proposal/choices";
import { sentenceOf } from "../verdict/verdict";
import { FlightMarkers, PredictionResult } from "./FlightMarkers";
import classes from "./FlightsPanel.module.css";
import type { Sortable } from "./flightsTable";

export interface FlightColumn {
  id: string;
  title: string;
  detail?: string | undefined;
  topic?: Topic;
  className?: string | undefined;
  /** Hidden until it is chosen. */
  extra?: boolean;
  value: (trial: Trial) => Sortable;
  cell: (trial: Trial) => ReactNode;
}

function Predicted({ trial, unit }: { trial: Trial; unit: string }) {
  return (
    <>
      <span className={classes["predicted"]}>
        {withUnit(trial.predicted_error, unit)}
        <PredictionResult trial={trial} brief />
      </span>
      {trial.predicted_interval && (
        <small className={classes["range"]}>{rangeText(trial.predicted_interval, unit)}</small>
      )}
    </>
  );
}

const KINDS: Record<Trial["kind"], string> = {
  start: "Start",
  step: CHOICES.step.label,
  "shorter step": CHOICES["smaller step"].label,
  repeat: CHOICES.repeat.label,
  baseline: CHOICES.baseline.label,
  manual: CHOICES.own.label,
};

function State({ trial }: { trial: Trial }) {
  return (
    <span className={classes["state"]}>
      <StateBadge words={trialStateLabel(trial.state)} />
      <FlightMarkers trial={trial} />
    </span>
  );
}

/** The columns after the flight number, from the left: gains and results as in the paper's Table 1. */
export function flightColumns(
  trials: readonly Trial[],
  gainTitles: Readonly<Record<string, string>>,
  unit: string,
): readonly FlightColumn[] {
  const gains = Object.keys(trials[0]?.gains ?? {}).map((name) => ({
    id: name,
    title: name,
    detail: gainTitles[name],
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
      cell: (trial) => <Predicted trial={trial} unit={unit} />,
    },
    {
      id: "state",
      title: "State",
      className: classes["text"],
      value: ({ state }) => trialStateLabel(state).word,
      cell: (trial) => <State trial={trial} />,
    },
    ...measures,
    {
      id: "flown",
      title: "Flown",
      className: classes["text"],
      extra: true,
      value: ({ flown_at }) => flown_at,
      cell: ({ flown_at }) => <Time at={flown_at} />,
    },
    {
      id: "kind",
      title: "Kind",
      className: classes["text"],
      extra: true,
      value: ({ kind }) => KINDS[kind],
      cell: ({ kind }) => KINDS[kind],
    },
    {
      id: "verdict",
      title: "Verdict",
      className: `${classes["text"]} ${classes["verdict"]}`,
      value: (trial) => sentenceOf(trial) || null,
      cell: (trial) => sentenceOf(trial) || NOTHING,
    },
  ];
}
