import { expect, test } from "vitest";
import type { Trial } from "../../../api/types";
import {
  bestBeforeOf,
  bestBeforeTitle,
  comparedWith,
  marksOf,
  predictionResult,
  repeatPurpose,
  sentenceOf,
  shownTrial,
} from "./verdict";

const trial = (number: number, state: Trial["state"], error: number | null) =>
  ({ id: number, number, state, error, glitches: [] }) as unknown as Trial;

const first = trial(1, "valid", 0.3267);
const glitch = trial(2, "invalid", 0.05);
const third = trial(3, "valid", 0.1873);
const all = [first, glitch, third, trial(4, "planned", null)];

test("a flight is compared with the best valid one before it", () => {
  expect(bestBeforeOf(third, all)?.number).toBe(1);
  expect(bestBeforeOf(first, all)).toBeNull();
});

test("the best before a flight is still the best so far, or was", () => {
  const worse = trial(4, "valid", 0.2);
  expect(bestBeforeTitle(worse, [...all.slice(0, 3), worse])).toBe("Best so far");
  expect(bestBeforeTitle(third, all)).toBe("Previous best");
});

test("the link beside a verdict compares with the best, and the best with the first", () => {
  expect(comparedWith(glitch, all, 3)).toEqual([3, 2]);
  expect(comparedWith(third, all, 3)).toEqual([1, 3]);
  expect(comparedWith(glitch, all, undefined)).toEqual([1, 2]);
  expect(comparedWith(first, all, 1)).toEqual([1]);
});

test("an aborted flight says why, and not twice that it was aborted", () => {
  const aborted = { ...trial(5, "aborted", null), reason: "aborted by the operator", verdict: "Aborted: …" } as Trial;
  expect(sentenceOf(aborted)).toBe("Aborted by the operator");
  expect(sentenceOf({ ...third, verdict: "0.187 m: …", reason: "" } as Trial)).toBe("0.187 m: …");
  expect(sentenceOf({ ...glitch, verdict: "", reason: "Wind gust" } as Trial)).toBe("Wind gust");
});

test("the latest flight is shown until another is chosen; a plan is no flight", () => {
  expect(shownTrial(all, null, { state: "deciding" })?.number).toBe(3);
  expect(shownTrial(all, 2, { state: "deciding" })?.number).toBe(2);
  expect(shownTrial(all, 4, { state: "deciding" })?.number).toBe(3);
  expect(shownTrial([], null, { state: "deciding" })).toBeNull();
});

test("a finished campaign shows its result, and a flight only when it is selected", () => {
  expect(shownTrial(all, null, { state: "finished" })).toBeNull();
  expect(shownTrial(all, 2, { state: "finished" })?.number).toBe(2);
  expect(shownTrial(all, 4, { state: "finished" })).toBeNull();
  expect(shownTrial(all, null, { state: "archived" })).toBeNull();
});

test("an error lies inside of, above or below what was predicted", () => {
  const expected = { ...third, predicted_interval: { lower: 0.18, upper: 0.22, confidence: 0.9 } };
  expect(predictionResult(expected)).toBe("inside");
  expect(predictionResult({ ...expected, error: 0.23 })).toBe("above");
  expect(predictionResult({ ...expected, error: 0.1 })).toBe("below");
  expect(predictionResult({ ...expected, error: null })).toBeNull();
  expect(predictionResult(third)).toBeNull();
});

test("an overruled flight and one with glitches are marked", () => {
  const gap = { kind: "gap" as const, start_s: 3, end_s: 3.4, sentence: "Nothing was recorded for 0.4 s." };
  expect(marksOf({ ...third, overrule_reason: "the paper flew it", glitches: [gap, gap] })).toEqual([
    "Gate overruled",
    "2 glitches",
  ]);
  expect(marksOf(third)).toEqual([]);
});

test("a flight that repeats gains on purpose is held against its own prediction", () => {
  const interval = { lower: 0.3, upper: 0.4, confidence: 0.9 };
  const again = { ...first, kind: "baseline", predicted_interval: interval } as Trial;
  expect(repeatPurpose(again)).toMatch(/^Baseline flight: repeats the first gains .* inside its predicted interval/);
  expect(repeatPurpose({ ...again, error: 0.5 })).toContain("above its predicted interval");
  expect(repeatPurpose({ ...again, kind: "step" })).toBe("");
});
