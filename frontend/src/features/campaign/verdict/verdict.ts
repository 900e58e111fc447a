/** Texts and decisions about the result of a flight. */

import type { Campaign, CampaignStatistics, RepeatGroup, Trial, Vehicle } from "../../../api/types";
import { count, flightsText } from "../../../ui/format";
import { gainsInBrackets, inOrder, safeGainsWritten, sameHeld } from "../../../ui/gains";
import { wasFlown } from "../../../ui/states";

export const VERDICTS = {
  better: "Better",
  worse: "Worse",
  unresolved: "Unresolved",
  "not known yet": "Not known yet",
} as const;

/** Position of the error relative to its predicted interval; null if one is missing. */
export function predictionResult(trial: Trial): "inside" | "above" | "below" | null {
  const { predicted_interval: interval, error } = trial;
  if (!interval || error === null) return null;
  if (error < interval.lower) return "below";
  return error > interval.upper ? "above" : "inside";
}

/** Whether the scatter is only the prior estimate, because no gain set has two valid flights. */
export function isPriorScatter({ sigma, groups }: Pick<CampaignStatistics, "sigma" | "groups">): boolean {
  return sigma !== null && sigma > 0 && groups.every(({ errors }) => errors.length < 2);
}

/** What the ± of a single flight's error is. */
export function scatterMeaning(statistics: Pick<CampaignStatistics, "sigma" | "groups">): string {
  return isPriorScatter(statistics) ? "± prior estimate of the scatter" : "± flight-to-flight scatter";
}

const ASKED: Partial<Record<Trial["kind"], string>> = {
  baseline: "Baseline flight: repeats the first gains to check whether the vehicle has changed.",
  repeat: "Repeat flight: flies earlier gains again to measure the scatter.",
};

const KEPT = {
  inside: "The error is inside its predicted interval: no change detected.",
  above: "The error is above its predicted interval: check the vehicle.",
  below: "The error is below its predicted interval: check the vehicle.",
} as const;

/** Purpose of a flight that repeats gains, and its result against its prediction; empty for other flights. */
export function repeatPurpose(trial: Trial): string {
  const why = ASKED[trial.kind];
  if (why === undefined || trial.state !== "valid") return "";
  const kept = predictionResult(trial);
  return kept === null ? why : `${why} ${KEPT[kept]}`;
}

/** Markers of a flight besides its class. */
export function marksOf(trial: Trial): string[] {
  const glitches = trial.glitches?.length ?? 0;
  return [
    trial.overrule_reason ? "Gate overruled" : "",
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

/** Whether the operator withdrew the last flight before it took off, as by unstaging. */
export function isWithdrawnByOperator({ flight }: Pick<Trial, "flight">): boolean {
  return flight !== null && flight.state === "cancelled" && flight.end?.request?.by === "operator";
}

type AbortWord = "behaved badly" | "something else";

/** Whether an aborted flight counts against its gains; empty for other flights. */
export function abortSentence({ state, abort_cause: cause }: Pick<Trial, "state" | "abort_cause">): string {
  if (state !== "aborted") return "";
  switch (cause) {
    case "limit":
      return "A limit was exceeded: the flight counts against its gains.";
    case "operator":
      return "Why was the flight aborted? It counts against its gains only if the cause was the vehicle's behaviour.";
    case "behaved badly":
      return "Aborted because of the vehicle's behaviour: the flight counts against its gains.";
    case "something else":
      return "Aborted for another cause: the flight does not count against its gains.";
    default:
      return "Abort cause not recorded: the flight counts against its gains.";
  }
}

/** Causes that the operator can select: those other than the current one. */
export function abortWords({
  actions,
  abort_cause: cause,
}: Pick<Trial, "actions" | "abort_cause">): readonly AbortWord[] {
  if (!actions.includes("judge abort")) return [];
  return (["behaved badly", "something else"] as const).filter((word) => word !== cause);
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
function bestOfCounted(trials: readonly Trial[]): Trial | null {
  return bestBeforeOf({ number: Infinity }, trials);
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

type Repeated = Pick<RepeatGroup, "errors">;
type Variant = "repeat" | "baseline";

/** The flights that are missing until the best and the first gains have each flown twice. */
export function confirmationOf(winner: Repeated | undefined, first: Repeated | undefined): Variant[] {
  const missing = (variant: Variant, group: Repeated | undefined) =>
    Array<Variant>(group === undefined ? 0 : Math.max(0, 2 - group.errors.length)).fill(variant);
  return [...missing("repeat", winner), ...missing("baseline", first)];
}

/** What the flights of a confirmation are for. */
export function confirmationText(plan: readonly Variant[]): string {
  const of = (variant: Variant, gains: string) => {
    const flights = plan.filter((one) => one === variant).length;
    return flights === 0 ? [] : [`${count(flights, "more flight")} with the ${gains} gains`];
  };
  const parts = [...of("repeat", "best"), ...of("baseline", "first")];
  return `The best and the first gains must each be flown at least twice: ${parts.join(" and ")}.`;
}

/** Why the campaign ended, without the verdict, which is shown beside it. */
export function endingOf(
  { stop_reason: reason }: Pick<Campaign, "stop_reason">,
  comparison: Pick<NonNullable<CampaignStatistics["comparison"]>, "sentence"> | null,
): string {
  return comparison === null ? reason : reason.replace(comparison.sentence, "").replaceAll("  ", " ").trim();
}

/** Whether the best gains may become the vehicle's safe gains; if not, the reason and the action. */
export function promotable(
  winner: Campaign["winner"],
  { name, safe_gains: safe }: Pick<Vehicle, "name" | "safe_gains">,
): { possible: boolean; why: string } {
  if (winner !== null && sameHeld(safe, winner.gains))
    return { possible: false, why: `The best gains are the safe gains of ${name}.` };
  const verdict = winner?.verdict ?? null;
  if (verdict === "better") return { possible: true, why: "" };
  if (verdict === null)
    return {
      possible: false,
      why: "The best gains so far are the first flight's. Only gains that are shown to be better than these can become the safe gains: fly others first.",
    };
  return {
    possible: false,
    why: `The best gains cannot become the safe gains of ${name}: their verdict is “${verdict}”. Fly the best and the first gains again until the verdict is “better”.`,
  };
}

/** After a change of the safe gains: the gains on the vehicle until the new ones are written; empty if they are written
 * or the vehicle's gains are unknown. */
export function heldGainsNotice({
  name,
  state,
  identity,
  held,
  safe_gains: safe,
}: Pick<Vehicle, "name" | "state" | "identity" | "held" | "safe_gains">): string {
  if (held === null || Object.keys(held).length === 0 || sameHeld(held, safe)) return "";
  const gains = gainsInBrackets(inOrder(held, Object.keys(safe)));
  const reading = state === "disconnected" ? `held ${gains} when last read` : `still holds ${gains}`;
  return `${name} ${reading}. ${safeGainsWritten({ state, identity })}`;
}

const LEFT = {
  other: "The safe gains are not on the vehicle. Inspect it before the next flight.",
  flight:
    "The safe gains were not restored, because a pilot took control: the vehicle was left with the flight's gains. Once it has landed and its motors have stopped, restore them on the vehicle's page.",
  unknown: "It is not known whether the safe gains were restored. Inspect the vehicle before the next flight.",
} as const;

/** Which gains a flight left on the vehicle whose safe gains were not read back after it. */
export function leftGainsText({ end }: Pick<NonNullable<Trial["flight"]>, "end">): string {
  const left = end?.gains_left ?? "unknown";
  return LEFT[left === "safe" ? "unknown" : left];
}

/** Failures without a sentence of their own: what a quarantined vehicle says is the whole reason. */
const EXPLAINED_BY_REMARKS: readonly string[] = ["F7", "F8"];

/** Whether the vehicle's reason of quarantine is that of the flight's end too. */
export function isToldByVehicle(
  trial: Pick<Trial, "given_reason" | "end">,
  { state }: Pick<Vehicle, "state">,
): boolean {
  return (
    state === "quarantined" && trial.given_reason === "" && EXPLAINED_BY_REMARKS.includes(trial.end?.failure ?? "")
  );
}

export const INVALID_REASONS = ["Wind gust", "Tracking glitch", "Wrong setup", "Low battery", "Collision"];

/** Classes that a flight can be changed to. */
export function otherClasses(trial: Trial): ("valid" | "aborted" | "invalid")[] {
  if (!trial.actions.includes("classify")) return [];
  switch (trial.state) {
    case "valid":
    case "aborted":
      return ["invalid"];
    case "invalid":
      if (trial.flight?.state === "aborted") return ["aborted"];
      return trial.may_be_valid ? ["valid"] : [];
    case "captured":
      return trial.may_be_valid ? ["valid", "aborted", "invalid"] : ["aborted", "invalid"];
    case "lost":
      return ["invalid"];
    default:
      return [];
  }
}

export interface Suggestion {
  outcome: "valid" | "aborted" | "invalid";
  why: string;
}

/** Suggested class and its reason; the operator decides. */
export function suggestedClass(
  trial: Pick<Trial, "state" | "record" | "may_be_valid" | "glitches" | "reason">,
): Suggestion | null {
  if (trial.state === "lost") return { outcome: "invalid", why: trial.reason || "the end of the flight is unknown" };
  if (trial.state !== "captured" || trial.record === null) return null;
  switch (trial.record.ending) {
    case "invalid":
      return { outcome: "invalid", why: trial.reason || "the measurement is unusable" };
    case "aborted":
      return { outcome: "aborted", why: trial.reason || "the flight was aborted" };
    case "completed": {
      if (!trial.may_be_valid) return { outcome: "invalid", why: "the record ends before the scored window does" };
      const glitches = trial.glitches.length;
      if (glitches === 0) return { outcome: "valid", why: "the record is complete and without glitches" };
      return { outcome: "invalid", why: `the record has ${glitches} glitch${glitches === 1 ? "" : "es"}` };
    }
  }
}
