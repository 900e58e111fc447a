/** What a finished flight is worth, and against what. */

import type { Trial } from "../api/types";
import { wasFlown } from "./states";

export const VERDICTS = { better: "Better", worse: "Worse", unresolved: "Unresolved" } as const;

/** Where the error came to lie against what was predicted; null without an interval or an error. */
export function keptPrediction(trial: Trial): "inside" | "above" | "below" | null {
  const { predicted_interval: interval, error } = trial;
  if (!interval || error === null) return null;
  if (error < interval.lower) return "below";
  return error > interval.upper ? "above" : "inside";
}

const ASKED: Partial<Record<Trial["kind"], string>> = {
  baseline: "Asked for: the first flight's gains once more, to see whether the vehicle has changed.",
  repeat: "Asked for: gains flown before once more, to see how much flights scatter.",
};

const KEPT = {
  inside: "It ended inside its prediction: nothing has changed.",
  above: "It ended above its prediction: worth a look.",
  below: "It ended below its prediction: worth a look.",
} as const;

/** Of a flight that repeats gains on purpose: why, and how it ended against its own prediction; empty for others. */
export function askedFor(trial: Trial): string {
  const why = ASKED[trial.kind];
  if (why === undefined || trial.state !== "valid") return "";
  const kept = keptPrediction(trial);
  return kept === null ? why : `${why} ${KEPT[kept]}`;
}

/** What makes a flight special beside its class, in few words. */
export function marksOf(trial: Trial): string[] {
  const glitches = trial.glitches?.length ?? 0;
  return [
    trial.overrule_reason ? "Overruled" : "",
    glitches > 0 ? `${glitches} glitch${glitches === 1 ? "" : "es"}` : "",
  ].filter((mark) => mark !== "");
}

/** The valid flight with the lowest error before this one. */
export function bestBeforeOf(trial: Trial, trials: readonly Trial[]): Trial | null {
  const before = trials.filter((one) => one.state === "valid" && one.number < trial.number && one.error !== null);
  return before.reduce<Trial | null>(
    (best, one) => (best === null || (one.error ?? 0) < (best.error ?? 0) ? one : best),
    null,
  );
}

/** The verdict in a sentence, or the reason where there is none; "Aborted" and "Lost" stand beside it already. */
export function sentenceOf(trial: Trial): string {
  if (!["aborted", "lost"].includes(trial.state) || trial.reason === "") return trial.verdict || trial.reason;
  return trial.reason.charAt(0).toUpperCase() + trial.reason.slice(1);
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
