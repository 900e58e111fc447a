import { expect, test } from "vitest";
import type { Campaign, NextFlight, Proposal, Trial } from "../../../api/types";
import { flyingStage, isWithdrawnByOperator, nextStep, STAGED } from "./nextStep";

const campaign = {
  state: "deciding",
  flying: null,
  best: { trial_id: 7 },
  rehearsal: { state: "not needed" },
} as unknown as Campaign;
const flying = { ...campaign, flying: { trial_id: 8, trial_number: 2 } };
const proposal = { kind: "step", recommended: "step", stale: false } as unknown as Proposal;
const ready: NextFlight = { state: "ready", proposal, problem: null };
const trial = (id: number, state: Trial["state"]): Trial => ({ id, state }) as unknown as Trial;

test("a fresh proposal is what to do next", () => {
  expect(nextStep(campaign, ready, [trial(7, "valid")])).toEqual({ kind: "propose", proposal });
});

test("what flies comes before everything else", () => {
  expect(nextStep(flying, ready, [trial(8, "flying")])).toEqual({ kind: "flying", flight: flying.flying });
});

test("a flight is in flight from its takeoff on, as the bar says, even before the first sample", () => {
  const waiting = { ...trial(8, "staged"), flight: { mode: "stage", take_off_at: null } } as unknown as Trial;
  const none = { phase: "staged", timeS: [] };
  expect(flyingStage(trial(8, "planned"), null)).toBe("Waiting for the worker");
  expect(flyingStage(trial(8, "staged"), { ...none, phase: "staging" })).toBe("Staging");
  expect(flyingStage(waiting, none)).toBe(STAGED);
  expect(flyingStage(trial(8, "staged"), { ...none, phase: "flying" })).toBe("In flight");
  expect(flyingStage(trial(8, "flying"), null)).toBe("In flight");
});

test("a flight that has landed is not flying any more, even if the campaign is not up to date yet", () => {
  expect(nextStep(flying, ready, [trial(8, "valid")])).toEqual({ kind: "computing" });
  expect(nextStep(flying, ready, [trial(8, "captured")])).toEqual({ kind: "judge", trial: trial(8, "captured") });
});

test("a stale proposal is never offered", () => {
  const stale: NextFlight = { ...ready, state: "ready", proposal: { ...proposal, stale: true } };
  expect(nextStep(campaign, stale, [])).toEqual({ kind: "computing" });
  expect(nextStep(campaign, { ...stale, state: "computing" }, [])).toEqual({ kind: "computing" });
});

test("a flight that nobody has judged comes before the next one", () => {
  const lost = trial(8, "lost");
  expect(nextStep(campaign, ready, [trial(7, "valid"), lost])).toEqual({ kind: "judge", trial: lost });
});

test("a real vehicle's campaign is rehearsed before anything else is offered", () => {
  const real = (state: string) => ({ ...campaign, rehearsal: { state } }) as unknown as Campaign;
  for (const state of ["missing", "under way", "failed"]) {
    expect(nextStep(real(state), ready, [trial(8, "planned")])).toEqual({ kind: "rehearse" });
  }
  expect(nextStep(real("passed"), ready, [])).toEqual({ kind: "propose", proposal });
});

test("a planned trial waits for its flight or its record", () => {
  const planned = trial(8, "planned");
  expect(nextStep(campaign, ready, [planned])).toEqual({ kind: "planned", trial: planned });
});

test.each(["failed", "none"] as const)("gains that could not be computed (%s) can be asked for again", (state) => {
  const problem = { title: "No.", detail: "", hint: "" };
  expect(nextStep(campaign, { state, proposal: null, problem }, [])).toEqual({ kind: "failed", problem });
});

test("a finished campaign offers no flight", () => {
  expect(nextStep({ ...campaign, state: "finished" }, ready, [])).toEqual({ kind: "finished" });
});

test("a flight that the operator unstaged did not fail", () => {
  const flight = (state: string, by?: string) =>
    ({ flight: { id: 1, state, end: { request: by === undefined ? null : { by } } } }) as Trial;
  expect(isWithdrawnByOperator(flight("cancelled", "operator"))).toBe(true);
  expect(isWithdrawnByOperator(flight("cancelled", "another browser"))).toBe(false);
  expect(isWithdrawnByOperator(flight("cancelled"))).toBe(false);
  expect(isWithdrawnByOperator(flight("failed"))).toBe(false);
  expect(isWithdrawnByOperator({ flight: null })).toBe(false);
});
