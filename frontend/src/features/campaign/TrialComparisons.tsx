import { IconCircleArrowDown, IconCircleArrowUp, IconHelpHexagon } from "@tabler/icons-react";
import type { Trial } from "../../api/types";
import { confidenceText, plusMinus } from "../../ui/uncertainty";
import classes from "./Verdict.module.css";
import { repeatPurpose, VERDICTS } from "./verdict";

const ICONS = {
  better: IconCircleArrowDown,
  worse: IconCircleArrowUp,
  unresolved: IconHelpHexagon,
  "not known yet": IconHelpHexagon,
} as const;

/** Verdicts of the flight's gains against the best before it and against the first. */
export function TrialComparisons({ trial, unit }: { trial: Trial; unit: string }) {
  if (trial.comparisons.length === 0) return null;
  const asked = repeatPurpose(trial) !== "";
  return (
    <ul className={classes["comparisons"]}>
      {trial.comparisons.map(({ against, trial_number, verdict, confidence, difference, standard_error }) => {
        const Icon = ICONS[verdict];
        return (
          <li key={against} data-verdict={asked ? undefined : verdict} className="numbers">
            <Icon size={20} className={classes["sign"]} aria-hidden />
            <span>
              {asked ? `These gains: ${VERDICTS[verdict].toLowerCase()}` : <strong>{VERDICTS[verdict]}</strong>},{" "}
              {confidence === null ? "" : `${confidenceText(confidence)} confidence, `}against{" "}
              {against === "first" ? "the first" : "the best before"}, flight {trial_number}:{" "}
              {plusMinus(Math.abs(difference), standard_error, unit)} {difference < 0 ? "lower" : "higher"}{" "}
              <small>{standard_error === null ? "(no gains were flown twice)" : "(± standard error)"}</small>
            </span>
          </li>
        );
      })}
    </ul>
  );
}
