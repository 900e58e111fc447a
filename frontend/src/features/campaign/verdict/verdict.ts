/** Texts and decisions about the result of a flight. */

import { IconCircleArrowDown, IconCircleArrowUp, IconHelpHexagon } from "@tabler/icons-react";
import type { Campaign, Trial } from "../../../api/types";
import { wasFlown } from "../../../ui/states";

/** Word and sign of a verdict. */
export const VERDICTS = {
  better: { word: "Better", Icon: IconCircleArrowDown, color: "var(--best)" },
  worse: { word: "Worse", Icon: IconCircleArrowUp, color: "var(--bad)" },
  unresolved: { word: "Unresolved", Icon: IconHelpHexagon, color: "var(--dim)" },
  "not known yet": { word: "Not known yet", Icon: IconHelpHexagon, color: "var(--dim)" },
} as const;

/** Position of the error relative to its predicted interval; null if one is missing. */
export function predictionResult(trial: Trial): "inside" | "above" | "below" | null {
  const { predicted_interval: interval, error } = trial;
  if (!interval || error === null) return null;
  if (error < interval.lower) return "below";
  return error > interval.upper ? "above" : "inside";
}

const ASKED: Partial<Record<Trial["kind"], string>> = {
  baseline: "Baseline flight: repeats the first gains to check whether the vehicle has changed.",
  repeat: "Repeat flight: flies earlier gains again to measure the scatter.",
};

/** Purpose of a flight that repeats gains, and its result against its prediction; empty for other flights. */
export function repeatPurpose(trial: Trial): string {
  const why = ASKED[trial.kind];
  if (why === undefined || trial.state !== "valid") return "";
  const result = predictionResult(trial);
  if (result === null) return why;
  const reading = result === "inside" ? "no change detected" : "check the vehicle";
  return `${why} The error is ${result} its predicted interval: ${reading}.`;
}

/** Markers of a flight besides its class. */
export function marksOf(trial: Trial): string[] {
  const glitches = trial.glitches.length;
  return [
    trial.overrule_reason ? "Gate overruled" : "",
    glitches > 0 ? `${glitches} glitch${glitches === 1 ? "" : "es"}` : "",
  ].filter((mark) => mark !== "");
}

/** The valid flight with the lowest error before this one. */
export function bestBeforeOf(trial: Pick<Trial, "number">, trials: readonly Trial[]): Trial | null {
  const before = trials.filter((one) => one.state === "valid" && one.number < trial.number && one.error !== null);
  return before.sort((one, other) => (one.error ?? 0) - (other.error ?? 0))[0] ?? null;
}

/** What the best flight before this one is by now: still the best, or only then. */
export function bestBeforeTitle(trial: Pick<Trial, "number">, trials: readonly Trial[]): string {
  const before = bestBeforeOf(trial, trials)?.number;
  return before === bestOfCounted(trials)?.number ? "Best so far" : "Previous best";
}

/** Whether the flight has an error, which its panel shows with all that the verdict sentence says. */
export function isScored({ state, error }: Pick<Trial, "state" | "error">): boolean {
  return state === "valid" && error !== null;
}

/** The verdict sentence, otherwise the reason. Without "Aborted" or "Lost", which the state badge shows. */
export function sentenceOf(trial: Trial): string {
  if (!["aborted", "lost"].includes(trial.state) || trial.reason === "") return trial.verdict || trial.reason;
  return trial.reason.charAt(0).toUpperCase() + trial.reason.slice(1);
}

/** The shown flight: the selected one, otherwise the latest. A finished campaign shows its result, and a flight only
 * once it is selected. */
export function shownTrial(
  trials: readonly Trial[],
  chosen: number | null,
  { state }: Pick<Campaign, "state">,
): Trial | null {
  const flown = trials.filter((trial) => wasFlown(trial.state));
  const isFinished = state === "finished" || state === "archived";
  return flown.find((trial) => trial.number === chosen) ?? (isFinished ? null : (flown.at(-1) ?? null));
}

/** The flights of a comparison of this one: the best, or for the best itself the first flown, as the reference. */
export function comparedWith(trial: Trial, trials: readonly Trial[], bestId: number | undefined): number[] {
  const first = trials.find(({ state }) => wasFlown(state))?.id;
  const reference = trial.id === bestId ? first : (bestId ?? first);
  return [...new Set([reference ?? trial.id, trial.id])];
}

/** The best valid flight: the lowest error, the earliest of equal ones. */
export function bestOfCounted(trials: readonly Trial[]): Trial | null {
  return bestBeforeOf({ number: Infinity }, trials);
}
