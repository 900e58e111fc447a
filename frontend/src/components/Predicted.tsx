import type { Proposal } from "../api/types";
import { against, percentChange, withUnit } from "../lib/format";
import { intervalText } from "../lib/uncertainty";
import { Help } from "./Help";
import classes from "./NextFlight.module.css";

interface Props {
  proposal: Proposal;
  best: number | null;
  unit: string;
}

/** What the flight is expected to score, as exactly as that is known. */
export function Predicted({ proposal, best, unit }: Props) {
  const { predicted_error: error, interval } = proposal;
  const change = percentChange(error, best);
  if (error === null)
    return <p className={classes["quiet"]}>Nothing is predicted: there is no model of these gains.</p>;
  return (
    <div className={`${classes["predicted"]} numbers`}>
      <span>
        Predicted
        <IntervalHelp />
      </span>
      <span>
        <strong>{withUnit(error, unit)}</strong>
        {interval && <small>{intervalText(interval, unit)}</small>}
        {change !== null && <small>{against(change, "the best")}</small>}
      </span>
    </div>
  );
}

export function IntervalHelp() {
  return (
    <Help question="What is the interval?">
      <p>
        Of ten flights, nine should end inside it. It counts how much flights with the same gains scatter, and how well
        the model is known.
      </p>
      <p>A flight outside teaches more than one inside: the model is off, or something happened to the vehicle.</p>
    </Help>
  );
}
