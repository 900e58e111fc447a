import { describe, expect, test } from "vitest";
import type { Gain, Proposal } from "../../../api/types";
import { changeText, type GainRow, gainRows, isOutside, placeIn, readGains, sliderStep } from "./gainRows";

const next = { kp: 1200, ki: 250 };
const changes = { kp: { now: 900, next: 1200, delta: 300 }, ki: { now: 200, next: 250, delta: 50 } };
const proposal = { changes } as unknown as Proposal;

describe("a table of gains", () => {
  const known = [
    { name: "kp", title: "Proportional gain", lower: 0, upper: 4000, integer: true },
    { name: "ki", title: "Integral gain", lower: 0, upper: 1073, integer: true },
  ] as Gain[];

  test("has the campaign's bounds before the experiment's", () => {
    expect(gainRows(proposal, next, known, { kp: [100, 2000] })).toEqual([
      { name: "kp", title: "Proportional gain", now: 900, next: 1200, bounds: [100, 2000], integer: true },
      { name: "ki", title: "Integral gain", now: 200, next: 250, bounds: [0, 1073], integer: true },
    ]);
  });

  test("has no bounds before the catalogue is there, and no gain where none is typed", () => {
    expect(gainRows(proposal, { kp: null, ki: 3 }, [], {})).toMatchObject([
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
