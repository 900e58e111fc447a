import { describe, expect, test } from "vitest";
import type { FlightChoice, Gain, Proposal } from "../../../api/types";
import {
  changeText,
  type GainRow,
  gainRows,
  isDoubtful,
  isOutside,
  placeIn,
  preselected,
  readGains,
  refusalOf,
  repeatSource,
  sliderStep,
  trialOf,
} from "./choices";

const first = { kp: 283, ki: 13 };
const best = { kp: 900, ki: 200 };
const next = { kp: 1200, ki: 250 };

function choice(kind: FlightChoice["kind"], gains: Record<string, number>, more: Partial<FlightChoice> = {}) {
  return { kind, gains, proposed: false, recommended: false, ...more };
}

const step = choice("step", next, { proposed: true });
const repeat = choice("repeat", best);

function proposal(...choices: FlightChoice[]): Proposal {
  const changes = { kp: { now: 900, next: 1200, delta: 300 }, ki: { now: 200, next: 250, delta: 50 } };
  return { id: 7, gains: next, changes, choices } as unknown as Proposal;
}

describe("what is chosen at first", () => {
  test("is what is recommended", () => {
    expect(preselected(proposal(step, { ...repeat, recommended: true }))).toBe("repeat");
  });

  test("is the proposal where the campaign should stop", () => {
    expect(preselected(proposal(step, repeat))).toBe("step");
  });
});

describe("what the button flies", () => {
  test("is the proposal by its number, so that the flight keeps the prediction", () => {
    expect(trialOf(proposal(step), step, next)).toEqual({ proposal_id: 7 });
  });

  test("is a variant with the gains that are shown, so that no others fly", () => {
    expect(trialOf(proposal(step, repeat), repeat, best)).toEqual({ variant: "repeat", gains: best });
  });

  test("is the gains that were typed", () => {
    expect(trialOf(proposal(step), undefined, first)).toEqual({ gains: first });
  });
});

describe("a table of gains", () => {
  const known = [
    { name: "kp", lower: 0, upper: 4000, integer: true },
    { name: "ki", lower: 0, upper: 1073, integer: true },
  ] as Gain[];

  test("has the campaign's bounds before the experiment's", () => {
    expect(gainRows(proposal(step), next, known, { kp: [100, 2000] })).toEqual([
      { name: "kp", now: 900, next: 1200, bounds: [100, 2000], integer: true },
      { name: "ki", now: 200, next: 250, bounds: [0, 1073], integer: true },
    ]);
  });

  test("has no bounds before the catalogue is there, and no gain where none is typed", () => {
    expect(gainRows(proposal(step), { kp: null, ki: 3 }, [], {})).toMatchObject([
      { next: null, bounds: null },
      { next: 3, bounds: null },
    ]);
  });
});

test.each([
  [900, 1143, "×1.27"],
  [13, 438, "×33.7"],
  [1070, 14, "÷76.4"],
  [4, 4, "same"],
  [0, 12, "+12"],
  [-2, 1, "+3"],
  [0.5, 0.25, "÷2"],
  [2, 0, "−2"],
])("the change from %d to %d is %s", (now, then, text) => {
  expect(changeText(now, then)).toBe(text);
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

test("a gain outside the bounds stands at their edge", () => {
  expect([placeIn([0, 400], 100), placeIn([0, 400], 900), placeIn([0, 400], -1), placeIn([3, 3], 3)]).toEqual([
    25, 100, 0, 0,
  ]);
});

test.each([
  [true, [0, 4000], 1],
  [false, [0, 4], 0.001],
  [false, [0, 10], 0.01],
  [false, [2, 2], 1],
] as const)("a slider moves in steps that can be felt", (integer, bounds, wanted) => {
  expect(sliderStep({ integer, bounds } as unknown as GainRow)).toBeCloseTo(wanted, 12);
});

describe("typed gains", () => {
  test("are flown as they are read", () => {
    expect(readGains({ kp: "400", ki: "−1.5" }, [])).toEqual({
      values: { kp: 400, ki: -1.5 },
      reasons: {},
      gains: { kp: 400, ki: -1.5 },
    });
  });

  test("are none while one of them is no number", () => {
    const { values, reasons, gains } = readGains({ kp: "4,5", ki: "20" }, []);
    expect([values, Object.keys(reasons), gains]).toEqual([{ kp: null, ki: 20 }, ["kp"], null]);
  });
});

test("a refusal names the gains, the reasons, and what would pass", () => {
  const bare = { worst: null, limit: null, gain: "", case: "", offer: {} };
  const outside = { gain: "kp", offer: { kp: 4000 } };
  const checks = [
    { ...bare, name: "bounds", passed: false, sentence: "kp must be between 0 and 4000.", ...outside },
    { ...bare, name: "altitude", passed: false, sentence: "It rises to 9 m." },
    { ...bare, name: "wrapping", passed: true, sentence: "No product can wrap." },
  ];
  expect(refusalOf({ passed: false, checks }).problems).toEqual([
    { field: "gains.kp", reason: "kp must be between 0 and 4000.", offer: { kp: 4000 } },
    { field: "gains", reason: "It rises to 9 m." },
  ]);
});

test("a gain in counts is read as a whole number only", () => {
  const known = [{ name: "kp", integer: true }];
  const { values, reasons, gains } = readGains({ kp: "82.5" }, known);
  expect([values, reasons, gains]).toEqual([{ kp: null }, { kp: "Enter a whole number." }, null]);
  expect(readGains({ kp: "x" }, known).reasons["kp"]).toContain("a whole number such as 400");
});

test("a gain beyond a bound is outside, one at it is not", () => {
  expect([-5, 0, 4000, 99999, null].map((next) => isOutside({ next, bounds: [0, 4000] }))).toEqual([
    true,
    false,
    false,
    true,
    false,
  ]);
});
