import { expect, test } from "vitest";
import type { Campaign, NextFlight, Proposal, Trial } from "../../../api/types";
import { flyingStage, isWithdrawnByOperator, type NextStep, nextStep, STAGED } from "./nextStep";

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

const rehearsed = (state: string) => ({ ...campaign, rehearsal: { state } }) as unknown as Campaign;
const planned = trial(8, "planned");
const lost = trial(8, "lost");
const captured = trial(8, "captured");
const stale: NextFlight = { ...ready, proposal: { ...proposal, stale: true } };
const problem = { title: "No.", detail: "", hint: "" };
const unknown = { proposal: null, problem };

test.each<[says: string, campaign: Campaign, next: NextFlight, trials: Trial[], step: NextStep]>([
  ["a fresh proposal is next", campaign, ready, [trial(7, "valid")], { kind: "propose", proposal }],
  ["what flies comes first", flying, ready, [trial(8, "flying")], { kind: "flying", flight: flying.flying }],
  [
    "what has landed flies no more, however old the campaign",
    flying,
    ready,
    [trial(8, "valid")],
    { kind: "computing" },
  ],
  ["what has landed is judged", flying, ready, [captured], { kind: "judge", trial: captured }],
  ["a stale proposal is never offered", campaign, stale, [], { kind: "computing" }],
  ["nor while another is computed", campaign, { ...stale, state: "computing" }, [], { kind: "computing" }],
  ["what nobody has judged comes before", campaign, ready, [trial(7, "valid"), lost], { kind: "judge", trial: lost }],
  ["a real vehicle is rehearsed first", rehearsed("missing"), ready, [planned], { kind: "rehearse" }],
  ["also while its rehearsal flies", rehearsed("under way"), ready, [planned], { kind: "rehearse" }],
  ["and again after one that failed", rehearsed("failed"), ready, [planned], { kind: "rehearse" }],
  ["after the rehearsal it flies", rehearsed("passed"), ready, [], { kind: "propose", proposal }],
  ["a planned trial waits for its flight or record", campaign, ready, [planned], { kind: "planned", trial: planned }],
  ["what failed can be asked for again", campaign, { ...unknown, state: "failed" }, [], { kind: "failed", problem }],
  ["and what was never asked for", campaign, { ...unknown, state: "none" }, [], { kind: "failed", problem }],
  ["a finished campaign offers no flight", { ...campaign, state: "finished" }, ready, [], { kind: "finished" }],
])("%s", (_says, campaign, next, trials, step) => {
  expect(nextStep(campaign, next, trials)).toEqual(step);
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

test("a flight that the operator unstaged did not fail", () => {
  const flight = (state: string, by?: string) =>
    ({ flight: { id: 1, state, end: { request: by === undefined ? null : { by } } } }) as Trial;
  expect(isWithdrawnByOperator(flight("cancelled", "operator"))).toBe(true);
  expect(isWithdrawnByOperator(flight("cancelled", "another browser"))).toBe(false);
  expect(isWithdrawnByOperator(flight("cancelled"))).toBe(false);
  expect(isWithdrawnByOperator(flight("failed"))).toBe(false);
  expect(isWithdrawnByOperator({ flight: null })).toBe(false);
});
