/** Texts and decisions about the review of a flight: its class, the consequences, and the cause of an abort. */

import type { Classification, Trial } from "../../../api/types";
import { flightsText } from "../../../ui/format";
import { sameHeld } from "../../../ui/gains";
import { bestOfCounted } from "../verdict/verdict";

const ABORT_SENTENCES: Record<NonNullable<Trial["abort_cause"]>, string> = {
  limit: "A limit was exceeded: the flight counts against its gains.",
  operator: "Why was the flight aborted? It counts against its gains only if the cause was the vehicle's behaviour.",
  "behaved badly": "Aborted because of the vehicle's behaviour: the flight counts against its gains.",
  "something else": "Aborted for another cause: the flight does not count against its gains.",
};

/** Whether an aborted flight counts against its gains; empty for other flights. */
export function abortSentence({ state, abort_cause: cause }: Pick<Trial, "state" | "abort_cause">): string {
  if (state !== "aborted") return "";
  return cause === null ? "Abort cause not recorded: the flight counts against its gains." : ABORT_SENTENCES[cause];
}

/** Causes that the operator can select: those other than the current one. */
export function abortWords({ actions, abort_cause: cause }: Pick<Trial, "actions" | "abort_cause">) {
  const words = ["behaved badly", "something else"] as const;
  return words.filter((word) => actions.includes("judge abort") && word !== cause);
}

/** Consequence of a class: which flight becomes the best, and which flights the next gains use. */
export function consequenceOf(trial: Trial, trials: readonly Trial[], outcome: Trial["state"]): string {
  const best = bestOfCounted(trials);
  if (outcome === "valid") {
    const until = best === null ? "" : ` Flight ${best.number} is the best of the others.`;
    return `Flight ${trial.number} is scored from its record and used for the next gains.${until}`;
  }
  const others = trials.filter(({ id }) => id !== trial.id);
  const other = bestOfCounted(others);
  if (other === null) {
    return `No other flight is valid. Without flight ${trial.number}, the campaign restarts from its start gains.`;
  }
  if (best?.id === trial.id) {
    const same = others.filter(({ state, gains }) => state === "valid" && sameHeld(gains, trial.gains));
    const change = sameHeld(other.gains, trial.gains)
      ? `the best gains stay the same, based on ${flightsText(same.map(({ number }) => number))} alone`
      : `flight ${other.number} becomes the best`;
    return `Flight ${trial.number} is the best. Without it, ${change}, and the next gains are recomputed.`;
  }
  return `Flight ${other.number} remains the best. The next gains are recomputed without flight ${trial.number}.`;
}

/** Standing of the campaign without an invalid flight; empty for other flights. */
export function standingWithout(trial: Trial, trials: readonly Trial[]): string {
  if (trial.state !== "invalid") return "";
  const best = bestOfCounted(trials);
  if (best === null) return "No flight is valid now. The next gains are the start gains.";
  return `Flight ${best.number} is the best. The next gains are computed without flight ${trial.number}.`;
}

export const INVALID_REASONS = ["Wind gust", "Tracking glitch", "Wrong setup", "Low battery", "Collision"];

/** Class of a reviewed flight. */
export type FlightClass = Classification["outcome"];

const OTHERS: Partial<Record<Trial["state"], FlightClass[]>> = {
  valid: ["invalid"],
  aborted: ["invalid"],
  lost: ["invalid"],
  invalid: ["valid"],
  captured: ["valid", "aborted", "invalid"],
};

/** Classes that a flight can be changed to. */
export function otherClasses(trial: Trial): FlightClass[] {
  if (!trial.actions.includes("classify")) return [];
  if (trial.state === "invalid" && trial.flight?.state === "aborted") return ["aborted"];
  return (OTHERS[trial.state] ?? []).filter((one) => one !== "valid" || trial.may_be_valid);
}

interface Suggestion {
  outcome: FlightClass;
  why: string;
}

const UNSCORED = { invalid: "the measurement is unusable", aborted: "the flight was aborted" };

/** Suggested class and its reason; the operator decides. */
export function suggestedClass(
  trial: Pick<Trial, "state" | "record" | "may_be_valid" | "glitches" | "reason">,
): Suggestion | null {
  if (trial.state === "lost") return { outcome: "invalid", why: trial.reason || "the end of the flight is unknown" };
  if (trial.state !== "captured" || trial.record === null) return null;
  const { ending } = trial.record;
  if (ending !== "completed") return { outcome: ending, why: trial.reason || UNSCORED[ending] };
  if (!trial.may_be_valid) return { outcome: "invalid", why: "the record ends before the scored window does" };
  const glitches = trial.glitches.length;
  if (glitches === 0) return { outcome: "valid", why: "the record is complete and without glitches" };
  return { outcome: "invalid", why: `the record has ${glitches} glitch${glitches === 1 ? "" : "es"}` };
}
