import { expect, test } from "vitest";
import type { Trial } from "../api/types";
import { askedFor, bestBeforeOf, keptPrediction, marksOf, otherClasses, sentenceOf, shownTrial } from "./verdict";

const trial = (number: number, state: Trial["state"], error: number | null, predicted_error: number | null = null) =>
  ({ number, state, error, predicted_error, actions: ["classify"] }) as unknown as Trial;

const first = trial(1, "valid", 0.3267);
const glitch = trial(2, "invalid", 0.05);
const third = trial(3, "valid", 0.1873, 0.2);
const all = [first, glitch, third, trial(4, "planned", null)];

test("a flight is compared with the best valid one before it", () => {
  expect(bestBeforeOf(third, all)?.number).toBe(1);
});

test("the first flight has nothing before it", () => {
  expect(bestBeforeOf(first, all)).toBeNull();
});

test("an aborted flight says why, and not twice that it was aborted", () => {
  const aborted = { ...trial(5, "aborted", null), reason: "aborted by the operator", verdict: "Aborted: …" } as Trial;
  expect(sentenceOf(aborted)).toBe("Aborted by the operator");
  expect(sentenceOf({ ...third, verdict: "0.187 m: …", reason: "" } as Trial)).toBe("0.187 m: …");
  expect(sentenceOf({ ...glitch, verdict: "", reason: "Wind gust" } as Trial)).toBe("Wind gust");
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

test("an error lies inside of, above or below what was predicted", () => {
  const expected = { ...third, predicted_interval: { lower: 0.18, upper: 0.22, confidence: 0.9 } };
  expect(keptPrediction(expected)).toBe("inside");
  expect(keptPrediction({ ...expected, error: 0.23 })).toBe("above");
  expect(keptPrediction({ ...expected, error: 0.1 })).toBe("below");
  expect(keptPrediction({ ...expected, error: null })).toBeNull();
  expect(keptPrediction(third)).toBeNull();
});

test("an overruled flight and one with glitches are marked", () => {
  const gap = { kind: "gap" as const, start_s: 3, end_s: 3.4, sentence: "Nothing was recorded for 0.4 s." };
  expect(marksOf({ ...third, overrule_reason: "the paper flew it", glitches: [gap, gap] })).toEqual([
    "Overruled",
    "2 glitches",
  ]);
  expect(marksOf(third)).toEqual([]);
});

test("a flight that repeats gains on purpose is held against its own prediction", () => {
  const interval = { lower: 0.3, upper: 0.4, confidence: 0.9 };
  const again = { ...first, kind: "baseline", predicted_interval: interval } as Trial;
  expect(askedFor(again)).toMatch(/^Asked for: the first flight's gains .* inside its prediction/);
  expect(askedFor({ ...again, error: 0.5 })).toContain("above its prediction");
  expect(askedFor({ ...again, kind: "step" })).toBe("");
});
