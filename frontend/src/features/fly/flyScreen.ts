/** State of the fly screen: step, label, gains, remaining time. */

import type { Trial, TrialState, Vehicle } from "../../api/types";
import type { Loss, Readiness } from "../../live/readiness";
import { type Aged, isAbortStep, oneOf, stepWord } from "../../live/vehicleStatus";
import { sameHeld } from "../../ui/gains";
import { bad, busy, good, quiet, type StateLabel, trialStateLabel } from "../../ui/states";

/**
 * plan: before staging. staged: gains are on the vehicle, before takeoff. unstaging: safe gains are restored. judge: it
 * landed and needs a review.
 */
export type FlyStep = "plan" | "staging" | "staged" | "unstaging" | "flying" | "judge" | "over";

const STEPS: Record<TrialState, FlyStep> = {
  planned: "plan",
  staged: "staged",
  flying: "flying",
  captured: "judge",
  lost: "judge",
  valid: "over",
  aborted: "over",
  invalid: "over",
  cancelled: "over",
};

type Standing = Pick<Trial, "state" | "flight">;

/** Current step of the flight. `phase` is from the event stream, which may be ahead of the stored state. */
export function flyStep(trial: Standing, phase: string | null): FlyStep {
  const step = STEPS[trial.state];
  const underWay = trial.flight?.state === "requested" || trial.flight?.state === "running";
  if (step === "plan" && underWay) return phase === "flying" ? "flying" : "staging";
  if (step !== "staged") return step;
  if (phase === "flying" || trial.flight?.take_off_at) return "flying";
  return trial.flight?.standing_down ? "unstaging" : "staged";
}

const WORDS: Record<FlyStep, StateLabel> = {
  plan: quiet("Planned"),
  staging: busy("Staging"),
  staged: good("Staged, ready to fly"),
  unstaging: busy("Restoring safe gains"),
  flying: busy("In flight"),
  judge: busy("Landed"),
  over: quiet("Finished"),
};

const isFlightStep = oneOf(
  "preflight",
  "arm",
  "take-off",
  "record",
  "land",
  "abort-land",
  "link lost",
  "disarm",
  "restore",
);

/** What is lost between this page and the vehicle's link: whether the link itself is, cannot be known then. */
const AWAY: Readonly<Partial<Record<Loss["kind"], string>>> = {
  "server away": "Server not responding",
  "worker away": "Worker not responding",
};

function stagedLabel(readiness: Readiness | null): StateLabel {
  if (readiness === null) return busy("Checking readiness");
  if (readiness.is_ready) return WORDS.staged;
  const isOnlyControl = readiness.losses.every(
    ({ kind }) => kind === "control ended" || kind === "controlled by other",
  );
  return isOnlyControl ? quiet("Staged") : bad("Not ready to fly");
}

interface Around {
  quarantined: boolean;
  readiness: Readiness | null;
  /** Whether it has flown, for a vehicle that is on the ground now. */
  hasFlown?: boolean;
  /** Whether this page has stopped its motors. */
  isStopped?: boolean;
  /** Whether its link was lost during this flight. */
  hasLostLink?: boolean;
}

/** Main label. For a vehicle with a link, `status` has the step; a stale one is never "In flight". */
export function flyStateLabel(
  trial: Standing,
  step: FlyStep,
  status: Aged | null,
  { quarantined, readiness, hasFlown = false, isStopped = false, hasLostLink = false }: Around,
): StateLabel {
  if (step === "flying" && status !== null) {
    const away = readiness?.losses.map(({ kind }) => AWAY[kind]).find((word) => word !== undefined);
    if (away !== undefined) return bad(away);
    if (!status.isCurrent) return bad(stepWord("link lost"));
    if (status.status.step === "abort-land" && hasLostLink) return bad("Landing after link loss");
    if (isFlightStep(status.status.step)) {
      return { word: stepWord(status.status.step), tone: isAbortStep(status.status.step) ? "bad" : "busy" };
    }
    if (isStopped) return bad("Motors off");
    if (!quarantined) return busy(hasFlown ? "Landed, restoring safe gains" : "Starting");
  }
  if (quarantined) return bad("Quarantined");
  if (step === "over" || (step === "judge" && trial.state === "lost")) return trialStateLabel(trial.state);
  return step === "staged" ? stagedLabel(readiness) : WORDS[step];
}

/** Whether the vehicle is in the air in this step. */
export const isAirborneStep = oneOf("take-off", "record", "land", "abort-land");

export interface GainTick {
  name: string;
  asked: number;
  /** Value on the vehicle; null if unknown. */
  held: number | null;
  confirmed: boolean;
}

type Gains = Readonly<Record<string, number>>;

/** Each gain with its value on the vehicle: as read back for this trial, otherwise as last received. */
export function gainTicks(asked: Gains, readBack: Gains | null, held: Gains): GainTick[] {
  return Object.entries(asked).map(([name, value]) => {
    const onVehicle = readBack?.[name] ?? held[name] ?? null;
    return { name, asked: value, held: onVehicle, confirmed: onVehicle === value };
  });
}

interface OnVehicle {
  /** Whether the staged gains are confirmed. */
  isHeld: boolean;
  readBack: Gains | null;
  /** Gains that the vehicle reports now; empty if they are unknown. */
  reported: Gains;
}

/** What the list of the flight's gains says of the vehicle: those read back for this flight count only while it has
 * them, not before they are staged and not after the flight, which ends with the safe gains. In flight the vehicle's own
 * report counts, if there is one. */
export function gainsShown(
  step: FlyStep,
  { isHeld, readBack, reported }: OnVehicle,
): { readBack: Gains | null; held: Gains; areSet: boolean } {
  const isOver = step === "judge" || step === "over";
  const isUnknown = Object.keys(reported).length === 0;
  const isOn = (step === "flying" && isUnknown) || (step === "staged" && isHeld);
  const areSet = step === "staging" || step === "staged" || step === "flying";
  return { readBack: isOn ? readBack : null, held: isOver ? {} : reported, areSet };
}

/** Whether the vehicle's safe gains have been read back after the lift-off of this flight, as at a reconnection. */
export function areReadBackSince(
  { flown_at }: Pick<Trial, "flown_at">,
  { held, held_at, safe_gains }: Pick<Vehicle, "held" | "held_at" | "safe_gains">,
): boolean {
  if (flown_at === null || held === null || held_at === null) return false;
  return Date.parse(held_at) > Date.parse(flown_at) && sameHeld(held, safe_gains);
}

/** Seconds until the end of the record; null before its begin or if its length is unknown. */
export function secondsLeft(lastS: number | undefined, endS: number | null): number | null {
  if (lastS === undefined || endS === null) return null;
  return Math.max(0, endS - lastS);
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
