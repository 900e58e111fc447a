import { describe, expect, test } from "vitest";
import type { Campaign, CampaignStatistics, Proposal, Trial } from "../../api/types";
import { advised, changesTo, choicesFor, expectationOf, sameGains } from "./proposal";

const first = { kp: 283, ki: 13, kd: 82 };
const better = { kp: 900, ki: 200, kd: 200 };
const next = { kp: 1200, ki: 250, kd: 230 };

function trial(number: number, gains: Record<string, number>, error: number): Trial {
  return { id: number, number, state: "valid", gains, error } as Trial;
}

function proposal(more: Partial<Proposal> = {}): Proposal {
  return { kind: "step", recommended: "step", gains: next, stop_verdict: { sentence: "Enough." }, ...more } as Proposal;
}

const campaign = (best: number | null) => ({ best: best === null ? null : { trial_id: best } }) as Campaign;
const two = [trial(1, first, 0.3), trial(2, better, 0.15)];

describe("what can be flown instead", () => {
  test("nothing before the first valid flight", () => {
    expect(choicesFor(campaign(null), proposal(), [])).toEqual([]);
  });

  test("half the step, the best again, and the first gains again", () => {
    expect(choicesFor(campaign(2), proposal(), two).map(({ variant }) => variant)).toEqual([
      "smaller step",
      "repeat",
      "baseline",
    ]);
  });

  test("with one flight the repeat is the baseline", () => {
    expect(choicesFor(campaign(1), proposal(), two.slice(0, 1)).map(({ variant }) => variant)).toEqual([
      "smaller step",
      "repeat",
    ]);
  });

  test("a proposed repeat is neither offered again nor halved", () => {
    expect(
      choicesFor(campaign(2), proposal({ kind: "repeat", gains: better }), two).map(({ variant }) => variant),
    ).toEqual(["baseline"]);
  });
});

describe("what a choice should score", () => {
  const statistics = {
    sigma: 0.0117,
    error_unit: "m",
    groups: [
      { gains: first, trial_numbers: [1], mean: 0.5283, is_best: false, is_baseline: true },
      { gains: better, trial_numbers: [2, 3], mean: 0.12845, is_best: true, is_baseline: false },
    ],
  } as unknown as CampaignStatistics;

  test("is what the flights of the same gains scored, with the scatter of one flight", () => {
    expect(expectationOf("repeat", statistics)).toBe(
      "[900 200 200], expected 0.128 ± 0.012 m, from flights 2, 3 (± scatter of one flight).",
    );
    expect(expectationOf("baseline", statistics)).toBe(
      "[283 13 82], expected 0.528 ± 0.012 m, from flight 1 (± scatter of one flight).",
    );
  });

  test("is not known for half a step, and that is said", () => {
    expect(expectationOf("smaller step", statistics)).toContain("No prediction");
  });

  test("is not said before the statistics are there", () => {
    expect(expectationOf("repeat", undefined)).toBe("");
  });
});

describe("what is recommended", () => {
  test("the proposal itself, where nothing else is advised", () => {
    expect(advised(proposal())).toMatchObject({ kind: "step", why: "", variant: null });
  });

  test("another flight of the best, where the step promises less than the noise", () => {
    const advice = { kind: "repeat", gains: better, why: "Promises less than noise." } as const;
    expect(advised(proposal({ advice }))).toEqual({
      kind: "repeat",
      why: "Promises less than noise.",
      gains: better,
      variant: "repeat",
    });
  });

  test("the proposal, where it is that repeat already", () => {
    const advice = { kind: "repeat", gains: better, why: "Was it luck?" } as const;
    expect(advised(proposal({ kind: "repeat", gains: better, advice })).variant).toBeNull();
  });

  test("an end, with the stop rule's own word", () => {
    expect(advised(proposal({ recommended: "stop" }))).toMatchObject({ kind: "stop", why: "Enough.", variant: null });
  });
});

test("a table of changes leads to the gains of the flight that it stands beside", () => {
  const changes = { kp: { now: 283, next: 400, delta: 117 }, kd: { now: 82, next: 90, delta: 8 } };
  expect(changesTo({ kp: 300, kd: 82 }, { ...proposal(), changes })).toEqual({
    kp: { now: 283, next: 300, delta: 17 },
    kd: { now: 82, next: 82, delta: 0 },
  });
});

test("gains are the same when every one of them is", () => {
  expect(sameGains(first, { ...first })).toBe(true);
  expect(sameGains(first, { ...first, kd: 83 })).toBe(false);
  expect(sameGains(first, { kp: 283 })).toBe(false);
});
