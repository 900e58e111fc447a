import { expect, test } from "vitest";
import type { Trial } from "../api/types";
import { compared, otherClasses, shownTrial } from "./verdict";

const trial = (number: number, state: Trial["state"], error: number | null, predicted_error: number | null = null) =>
  ({ number, state, error, predicted_error, actions: ["classify"] }) as unknown as Trial;

const first = trial(1, "valid", 0.3267);
const glitch = trial(2, "invalid", 0.05);
const third = trial(3, "valid", 0.1873, 0.2);
const all = [first, glitch, third, trial(4, "planned", null)];

test("a flight is compared with the best valid one before it, and with its prediction", () => {
  const found = compared(third, all);
  expect(found.bestBefore?.number).toBe(1);
  expect(found.againstBest).toBeCloseTo(-42.67, 2);
  expect(found.againstPrediction).toBeCloseTo(-6.35, 2);
});

test("the first flight has nothing before it", () => {
  expect(compared(first, all)).toEqual({ bestBefore: null, againstBest: null, againstPrediction: null });
});

test("the latest flight is shown until another is chosen; a plan is no flight", () => {
  expect(shownTrial(all, null)?.number).toBe(3);
  expect(shownTrial(all, 2)?.number).toBe(2);
  expect(shownTrial(all, 4)?.number).toBe(3);
  expect(shownTrial([], null)).toBeNull();
});

test("what a flight may be classed as follows from what it is", () => {
  expect(otherClasses(first)).toEqual(["invalid"]);
  expect(otherClasses(glitch)).toEqual(["valid"]);
  const stopped = { ...trial(5, "invalid", null), flight: { id: 1, state: "aborted", problem: "" } } as Trial;
  expect(otherClasses(stopped)).toEqual(["aborted"]);
  expect(otherClasses(trial(6, "captured", 0.2))).toEqual(["valid", "aborted", "invalid"]);
  expect(otherClasses({ ...first, actions: [] })).toEqual([]);
});
