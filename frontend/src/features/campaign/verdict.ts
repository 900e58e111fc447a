/** What a finished flight is worth, and against what. */

import type { Campaign, Trial, Vehicle } from "../../api/types";
import { gainsInBrackets, inOrder, sameHeld } from "../../ui/gains";
import { wasFlown } from "../../ui/states";

export const VERDICTS = {
  better: "Better",
  worse: "Worse",
  unresolved: "Unresolved",
  "not known yet": "Not known yet",
} as const;

/** Where the error came to lie against what was predicted; null without an interval or an error. */
export function predictionResult(trial: Trial): "inside" | "above" | "below" | null {
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
export function repeatPurpose(trial: Trial): string {
  const why = ASKED[trial.kind];
  if (why === undefined || trial.state !== "valid") return "";
  const kept = predictionResult(trial);
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
export function bestBeforeOf(trial: Pick<Trial, "number">, trials: readonly Trial[]): Trial | null {
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

type AbortWord = "behaved badly" | "something else";

/** What an aborted flight says of its gains; empty for others. */
export function abortSentence({ state, abort_cause: cause }: Pick<Trial, "state" | "abort_cause">): string {
  if (state !== "aborted") return "";
  switch (cause) {
    case "limit":
      return "A limit was met: the flight counts against its gains.";
    case "operator":
      return "Why was it aborted? It counts against its gains only if the vehicle behaved badly.";
    case "behaved badly":
      return "The vehicle behaved badly: the flight counts against its gains.";
    case "something else":
      return "It was something else: the flight does not count against its gains.";
    default:
      return "Nobody recorded why it was aborted: the flight counts against its gains.";
  }
}

/** What the operator may say of it now: what they have not said already. */
export function abortWords({
  actions,
  abort_cause: cause,
}: Pick<Trial, "actions" | "abort_cause">): readonly AbortWord[] {
  if (!actions.includes("judge abort")) return [];
  return (["behaved badly", "something else"] as const).filter((word) => word !== cause);
}

/** The flight that the page shows: the chosen one, else the latest. */
export function selectedTrial(trials: readonly Trial[], chosen: number | null): Trial | null {
  const flown = trials.filter((trial) => wasFlown(trial.state));
  return flown.find((trial) => trial.number === chosen) ?? flown.at(-1) ?? null;
}

/** Flights that count; the one with the lowest error, the earliest of equals, is the best. */
function bestOfCounted(trials: readonly Trial[]): Trial | null {
  return bestBeforeOf({ number: Infinity }, trials);
}

/** What classing a flight so would change: which flight is the best, and from what the next gains are computed. */
export function consequenceOf(trial: Trial, trials: readonly Trial[], outcome: Trial["state"]): string {
  const best = bestOfCounted(trials);
  if (outcome === "valid") {
    const until = best === null ? "" : ` Flight ${best.number} is the best of the others.`;
    return `Flight ${trial.number} is scored from its record, and the next gains are computed with it.${until}`;
  }
  const other = bestOfCounted(trials.filter(({ id }) => id !== trial.id));
  if (other === null) {
    return `No other flight counts: without flight ${trial.number} the campaign begins again at its start gains.`;
  }
  const anew = "and the next gains are computed anew";
  if (best?.id === trial.id)
    return `Flight ${trial.number} is the best; without it flight ${other.number} is, ${anew}.`;
  return `Flight ${other.number} stays the best, ${anew} without flight ${trial.number}.`;
}

/** Of a flight that does not count: what holds instead; empty for others. */
export function standingWithout(trial: Trial, trials: readonly Trial[]): string {
  if (trial.state !== "invalid") return "";
  const best = bestOfCounted(trials);
  if (best === null) return "No flight counts now: the next gains are the start gains.";
  return `Flight ${best.number} is the best now; the next gains are computed without flight ${trial.number}.`;
}

/** Whether the best gains may become the vehicle's safe ones; if not, why not, and what to do. */
export function promotable(
  { best, verdict }: Pick<Campaign, "best" | "verdict">,
  { name, safe_gains: safe }: Pick<Vehicle, "name" | "safe_gains">,
): { possible: boolean; why: string } {
  if (best !== null && sameHeld(safe, best.gains))
    return { possible: false, why: `The best gains are the safe ones of ${name}.` };
  if (verdict === "better") return { possible: true, why: "" };
  const because =
    verdict === null
      ? "no gains are better than the first ones yet"
      : `whether they are better is ${verdict === "not known yet" ? verdict : `${verdict} as yet`}`;
  return {
    possible: false,
    why: `The best gains cannot become the safe ones of ${name}: ${because}. Fly the best and the first ones again until the statistics say “better”.`,
  };
}

/** After a change of the safe gains: what is on the vehicle until they are written to it; empty when they are, or when
 * nobody has read what it holds. */
export function heldGainsNotice({
  name,
  state,
  held,
  safe_gains: safe,
}: Pick<Vehicle, "name" | "state" | "held" | "safe_gains">): string {
  if (held === null || Object.keys(held).length === 0 || sameHeld(held, safe)) return "";
  const gains = gainsInBrackets(inOrder(held, Object.keys(safe)));
  return state === "disconnected"
    ? `${name} held ${gains} when it was last read, and gets the safe ones when it is next connected.`
    : `${name} itself still holds ${gains}: the safe ones are written to it with its next check, restore or flight.`;
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
