/** What the fly screen shows and offers: where the flight is, in a word, and what is to be done. */

import type { Trial, TrialState } from "../../api/types";
import { type Aged, stepWord } from "../../live/vehicleStatus";
import { type StateLabel, trialStateLabel } from "../../ui/states";

/**
 * plan: gains to be set. staged: they are on the vehicle, which waits. unstaging: the safe gains go back. judge: it landed
 * and wants a person's word.
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

const UNDER_WAY: ReadonlySet<string> = new Set(["requested", "running"]);

/** Where the flight is. `phase` is the stream's word, which may run ahead of the record. */
export function flyStep(trial: Standing, phase: string | null): FlyStep {
  const step = STEPS[trial.state];
  const underWay = trial.flight !== null && UNDER_WAY.has(trial.flight.state);
  if (step === "plan" && underWay) return phase === "flying" ? "flying" : "staging";
  if (step !== "staged") return step;
  if (phase === "flying" || trial.flight?.take_off_at) return "flying";
  return trial.flight?.standing_down ? "unstaging" : "staged";
}

const WORDS: Record<FlyStep, StateLabel> = {
  plan: { word: "Planned", tone: "quiet" },
  staging: { word: "Setting the gains", tone: "busy" },
  staged: { word: "Gains set, ready to fly", tone: "good" },
  unstaging: { word: "Restoring safe gains", tone: "busy" },
  flying: { word: "Flying", tone: "busy" },
  judge: { word: "Landed", tone: "busy" },
  over: { word: "Over", tone: "quiet" },
};

const IN_FLIGHT: ReadonlySet<string> = new Set([
  "arm",
  "take-off",
  "record",
  "land",
  "abort-land",
  "link lost",
  "disarm",
  "restore",
]);

/** The one big word. Of a vehicle with a link of its own `status` tells the step; a silent one is never "Recording". */
export function flyStateLabel(trial: Standing, step: FlyStep, status: Aged | null, quarantined: boolean): StateLabel {
  if (step === "flying" && status !== null) {
    if (!status.isCurrent) return { word: stepWord("link lost"), tone: "bad" };
    if (IN_FLIGHT.has(status.status.step)) {
      const isBad = status.status.step === "link lost" || status.status.step === "abort-land";
      return { word: stepWord(status.status.step), tone: isBad ? "bad" : "busy" };
    }
    if (!quarantined) return { word: "Starting", tone: "busy" };
  }
  if (quarantined) return { word: "Quarantined", tone: "bad" };
  if (step === "over" || (step === "judge" && trial.state === "lost")) return trialStateLabel(trial.state);
  return WORDS[step];
}

export interface GainTick {
  name: string;
  asked: number;
  /** What the vehicle says it holds; null while it has not said. */
  held: number | null;
  confirmed: boolean;
}

type Gains = Readonly<Record<string, number>>;

/** Each gain with what the vehicle says of it: as read back for this trial, else as the link last told. */
export function gainTicks(asked: Gains, readBack: Gains | null, held: Gains): GainTick[] {
  return Object.entries(asked).map(([name, value]) => {
    const said = readBack?.[name] ?? held[name] ?? null;
    return { name, asked: value, held: said, confirmed: said === value };
  });
}

/** Seconds until the record is over; null before it has begun and where its length is not known. */
export function secondsLeft(lastS: number | undefined, endS: number | null): number | null {
  if (lastS === undefined || endS === null) return null;
  return Math.max(0, endS - lastS);
}

/** Where the first x axis of a figure ends: the length of the experiment. */
export function endOfTime(layout: Readonly<Record<string, unknown>> | undefined): number | null {
  const axis = layout?.["xaxis"];
  if (typeof axis !== "object" || axis === null || !("range" in axis) || !Array.isArray(axis.range)) return null;
  const end: unknown = axis.range[1];
  return typeof end === "number" ? end : null;
}

const FULL_THRUST = 0.995;

/** Whether the vehicle gives all the thrust there is. */
export function isSaturated(thrust: number): boolean {
  return thrust >= FULL_THRUST;
}
