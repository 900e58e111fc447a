import type { Proposal } from "../../api/types";
import { against, percentChange, withUnit } from "../../ui/format";
import { HelpTip } from "../../ui/HelpTip";
import { Note } from "../../ui/Note";
import { intervalText } from "../../ui/uncertainty";
import classes from "./NextFlight.module.css";

interface Props {
  proposal: Proposal;
  best: number | null;
  unit: string;
}

/** Predicted error with its interval. */
export function PredictedError({ proposal, best, unit }: Props) {
  const { predicted_error: error, interval } = proposal;
  const change = percentChange(error, best);
  if (error === null) return <Note fz="body">No prediction: there is no model of these gains.</Note>;
  return (
    <div className={`${classes["predicted"]} numbers`}>
      <span>
        Predicted
        <HelpTip topic="predicted" />
      </span>
      <span>
        <strong>{withUnit(error, unit)}</strong>
        {interval && (
          <small>
            {intervalText(interval, unit)}
            <HelpTip topic="interval" />
          </small>
        )}
        {change !== null && <small>{against(change, "the best")}</small>}
      </span>
    </div>
  );
}
