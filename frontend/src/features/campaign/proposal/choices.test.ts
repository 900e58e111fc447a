import { expect, test } from "vitest";
import type { FlightChoice, Proposal } from "../../../api/types";
import { isDoubtful, preselected, repeatSource, trialOf } from "./choices";

const first = { kp: 283, ki: 13 };
const best = { kp: 900, ki: 200 };
const next = { kp: 1200, ki: 250 };

function choice(kind: FlightChoice["kind"], gains: Record<string, number>, more: Partial<FlightChoice> = {}) {
  return { kind, gains, proposed: false, recommended: false, ...more };
}

const step = choice("step", next, { proposed: true });
const repeat = choice("repeat", best);

function proposal(...choices: FlightChoice[]): Proposal {
  return { id: 7, gains: next, choices } as unknown as Proposal;
}

test("the recommendation is chosen at first, else, where the campaign should stop, the proposal", () => {
  expect(preselected(proposal(step, { ...repeat, recommended: true }))).toBe("repeat");
  expect(preselected(proposal(step, repeat))).toBe("step");
});

test("the button flies the proposal by its number, to keep its prediction, otherwise the gains that are shown", () => {
  expect(trialOf(proposal(step), step, next)).toEqual({ proposal_id: 7 });
  expect(trialOf(proposal(step, repeat), repeat, best)).toEqual({ variant: "repeat", gains: best });
  expect(trialOf(proposal(step), undefined, first)).toEqual({ gains: first });
});

test("a repeat says of which flights it predicts the mean", () => {
  expect(repeatSource("repeat", { trial_numbers: [2, 3] })).toBe("mean of flights 2, 3 with these gains");
  expect(repeatSource("baseline", { trial_numbers: [1] })).toBe("error of flight 1 with these gains");
  expect(repeatSource("step", { trial_numbers: [1] })).toBe("");
});

test("start gains that were aborted because of them are doubtful", () => {
  const baseline = { kind: "baseline", gains: {}, proposed: true, recommended: false } as const;
  expect(isDoubtful({ kind: "start", choices: [baseline] })).toBe(true);
  expect(isDoubtful({ kind: "start", choices: [{ ...baseline, recommended: true }] })).toBe(false);
  expect(isDoubtful({ kind: "step", choices: [baseline] })).toBe(false);
});
