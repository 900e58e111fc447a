/** A finished flight against the best before it and against its prediction. */

import type { Trial } from "../api/types";
import { percentChange } from "./format";
import { wasFlown } from "./states";

export interface Comparison {
  /** Lowest error of the valid flights before this one. */
  bestBefore: Trial | null;
  againstBest: number | null;
  againstPrediction: number | null;
}

export function compared(trial: Trial, trials: readonly Trial[]): Comparison {
  const before = trials.filter((one) => one.state === "valid" && one.number < trial.number && one.error !== null);
  const bestBefore = before.reduce<Trial | null>(
    (best, one) => (best === null || (one.error ?? 0) < (best.error ?? 0) ? one : best),
    null,
  );
  return {
    bestBefore,
    againstBest: percentChange(trial.error, bestBefore?.error),
    againstPrediction: percentChange(trial.error, trial.predicted_error),
  };
}

/** The flight that the page shows: the chosen one, else the latest. */
export function shownTrial(trials: readonly Trial[], chosen: number | null): Trial | null {
  const flown = trials.filter((trial) => wasFlown(trial.state));
  return flown.find((trial) => trial.number === chosen) ?? flown.at(-1) ?? null;
}

export const INVALID_REASONS = ["Wind gust", "Tracking glitch", "Wrong set-up", "Battery low", "Touched something"];

/** What a flight can be classed as from here, apart from what it is. */
export function otherClasses(trial: Trial): ("valid" | "aborted" | "invalid")[] {
  if (!trial.actions.includes("classify")) return [];
  switch (trial.state) {
    case "valid":
    case "aborted":
      return ["invalid"];
    case "invalid":
      return [trial.flight?.state === "aborted" ? "aborted" : "valid"];
    case "captured":
      return ["valid", "aborted", "invalid"];
    case "lost":
      return ["invalid"];
    default:
      return [];
  }
}
