import { expect, test } from "vitest";
import type { CampaignStatistics, Trial } from "../../../api/types";
import {
  abortSentence,
  abortWords,
  bestBeforeOf,
  bestBeforeTitle,
  comparedWith,
  confirmationOf,
  confirmationText,
  consequenceOf,
  endingOf,
  heldGainsNotice,
  isToldByVehicle,
  isWithdrawnByOperator,
  leftGainsText,
  marksOf,
  otherClasses,
  predictionResult,
  promotable,
  repeatPurpose,
  scatterMeaning,
  sentenceOf,
  shownTrial,
  standingWithout,
  suggestedClass,
} from "./verdict";

const trial = (number: number, state: Trial["state"], error: number | null, predicted_error: number | null = null) =>
  ({
    id: number,
    number,
    state,
    error,
    predicted_error,
    gains: { kp: number },
    actions: ["classify"],
    may_be_valid: true,
  }) as unknown as Trial;

const first = trial(1, "valid", 0.3267);
const glitch = trial(2, "invalid", 0.05);
const third = trial(3, "valid", 0.1873, 0.2);
const all = [first, glitch, third, trial(4, "planned", null)];

test("a flight is compared with the best valid one before it", () => {
  expect(bestBeforeOf(third, all)?.number).toBe(1);
});

test("the best before a flight is still the best so far, or was", () => {
  const worse = trial(4, "valid", 0.2);
  expect(bestBeforeTitle(worse, [...all.slice(0, 3), worse])).toBe("Best so far");
  expect(bestBeforeTitle(third, all)).toBe("Previous best");
});

test("a candidate is confirmed by the flights that it lacks", () => {
  const flown = (times: number) => ({ errors: Array<number>(times).fill(0.2) });
  expect(confirmationOf(flown(1), flown(2))).toEqual(["repeat"]);
  expect(confirmationOf(flown(1), flown(1))).toEqual(["repeat", "baseline"]);
  expect(confirmationOf(flown(2), flown(3))).toEqual([]);
  expect(confirmationText(["repeat"])).toBe(
    "The best and the first gains must each be flown at least twice: 1 more flight with the best gains.",
  );
});

test("why a campaign ended is said without the verdict that stands beside it", () => {
  const reason = "All 7 flights of the budget have been flown. Better with 99 % confidence.";
  expect(endingOf({ stop_reason: reason }, { sentence: "Better with 99 % confidence." })).toBe(
    "All 7 flights of the budget have been flown.",
  );
  expect(endingOf({ stop_reason: reason }, null)).toBe(reason);
});

test("the first flight has nothing before it", () => {
  expect(bestBeforeOf(first, all)).toBeNull();
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

test("what a flight may be classed as follows from what it is", () => {
  expect(otherClasses(first)).toEqual(["invalid"]);
  expect(otherClasses(glitch)).toEqual(["valid"]);
  const stopped = { ...trial(5, "invalid", null), flight: { id: 1, state: "aborted", problem: "" } } as Trial;
  expect(otherClasses(stopped)).toEqual(["aborted"]);
  expect(otherClasses(trial(6, "captured", 0.2))).toEqual(["valid", "aborted", "invalid"]);
  expect(otherClasses({ ...first, actions: [] })).toEqual([]);
  expect(otherClasses({ ...glitch, may_be_valid: false })).toEqual([]);
  expect(otherClasses({ ...trial(6, "captured", 0.2), may_be_valid: false })).toEqual(["aborted", "invalid"]);
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

test("what a class would change is said before: which flight is the best then, and that the gains are found anew", () => {
  expect(consequenceOf(third, all, "invalid")).toBe(
    "Flight 3 is the best. Without it, flight 1 becomes the best, and the next gains are recomputed.",
  );
  const repeat = { ...trial(5, "valid", 0.19), gains: third.gains } as Trial;
  expect(consequenceOf(third, [...all, repeat], "invalid")).toBe(
    "Flight 3 is the best. Without it, the best gains stay the same, based on flight 5 alone, and the next gains are recomputed.",
  );
  expect(consequenceOf(first, all, "invalid")).toBe(
    "Flight 3 remains the best. The next gains are recomputed without flight 1.",
  );
  expect(consequenceOf(first, [first, glitch], "invalid")).toBe(
    "No other flight is valid. Without flight 1, the campaign restarts from its start gains.",
  );
  expect(consequenceOf(glitch, all, "valid")).toContain("is scored from its record");
  expect(standingWithout(glitch, all)).toBe("Flight 3 is the best. The next gains are computed without flight 2.");
  expect(standingWithout(third, all)).toBe("");
});

test("the best gains become the safe ones only once flights have shown that they are better", () => {
  const drone = { name: "Number 1", safe_gains: { kp: 283 } };
  const winner = { gains: { kp: 400 }, trial_numbers: [2, 3], verdict: "better" as const };
  expect(promotable(winner, drone)).toEqual({ possible: true, why: "" });
  expect(promotable({ ...winner, verdict: "unresolved" }, drone).why).toContain("their verdict is “unresolved”");
  expect(promotable({ ...winner, verdict: null }, drone).possible).toBe(false);
  expect(promotable({ ...winner, gains: { kp: 283 } }, drone).why).toBe(
    "The best gains are the safe gains of Number 1.",
  );
});

test("after a change of the safe gains it is told what the vehicle holds until they are written to it", () => {
  const identity = { system_id: 31, autopilot: "paparazzi", version: "", uid: "" };
  const gains = { held: { kd: 82, kp: 283 }, safe_gains: { kp: 400, kd: 100 } };
  const vehicle = { name: "Bee", state: "ready", identity, ...gains } as const;
  expect(heldGainsNotice(vehicle)).toBe(
    "Bee still holds [283 82]. The safe gains are written at the next check, restore or flight.",
  );
  expect(heldGainsNotice({ ...vehicle, state: "disconnected" })).toContain("at the next connection");
  expect(heldGainsNotice({ ...vehicle, state: "quarantined" })).toContain("or the vehicle is released");
  expect(heldGainsNotice({ ...vehicle, held: vehicle.safe_gains })).toBe("");
  expect(heldGainsNotice({ ...vehicle, held: null })).toBe("");
});

test("an operator's abort asks why, and counts against its gains only when they behaved badly", () => {
  const aborted = (abort_cause: Trial["abort_cause"]) => ({ ...trial(2, "aborted", null), abort_cause });
  expect(abortSentence(aborted("operator"))).toContain("only if the cause was the vehicle's behaviour");
  expect(abortSentence(aborted("something else"))).toContain("does not count against its gains");
  expect(abortSentence(aborted("limit"))).toBe("A limit was exceeded: the flight counts against its gains.");
  expect(abortSentence(first)).toBe("");
});

test("the operator may say what they have not said already, where the server lets them", () => {
  const actions = ["judge abort"];
  expect(abortWords({ actions, abort_cause: "operator" })).toEqual(["behaved badly", "something else"]);
  expect(abortWords({ actions, abort_cause: "behaved badly" })).toEqual(["something else"]);
  expect(abortWords({ actions: [], abort_cause: "limit" })).toEqual([]);
});

test("a class is suggested from how the record ended, with its reason", () => {
  const record = { ending: "completed" } as Trial["record"] & object;
  const landed = { state: "captured", record, may_be_valid: true, glitches: [], reason: "" } as const;
  expect(suggestedClass({ ...landed, may_be_valid: false, glitches: [] })?.outcome).toBe("invalid");
  expect(suggestedClass({ ...landed, glitches: [] })?.outcome).toBe("valid");
  expect(suggestedClass({ ...landed, glitches: [{} as Trial["glitches"][number]] })?.why).toContain("1 glitch");
  const doubted = {
    ...landed,
    glitches: [],
    record: { ...record, ending: "invalid" as const },
    reason: "clock jumped",
  };
  expect(suggestedClass(doubted)).toEqual({ outcome: "invalid", why: "clock jumped" });
  expect(suggestedClass({ ...landed, glitches: [], state: "valid" })).toBeNull();
  expect(suggestedClass({ ...landed, glitches: [], record: null, state: "lost" })?.outcome).toBe("invalid");
});

test("a scatter without a repeated gain set is named as the prior's", () => {
  const group = (...errors: number[]) => ({ errors }) as unknown as CampaignStatistics["groups"][number];
  expect(scatterMeaning({ sigma: 0.01, groups: [group(0.3), group(0.1)] })).toContain("prior");
  expect(scatterMeaning({ sigma: 0.01, groups: [group(0.3, 0.31), group(0.1)] })).not.toContain("prior");
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

test("a flight that a pilot took over left its own gains on the vehicle", () => {
  const left = (gains_left: "safe" | "other" | "flight" | "unknown") => leftGainsText({ end: { gains_left } });
  expect(left("flight")).toContain("left with the flight's gains");
  expect(left("unknown")).toContain("not known");
  expect(left("other")).toContain("not on the vehicle");
  expect(leftGainsText({ end: null })).toContain("not known");
});

test("how a flight ended is not repeated beside the quarantine that it led to", () => {
  const trial = (failure: "F6" | "F8", given_reason = "") => ({ given_reason, end: { failure } });
  expect(isToldByVehicle(trial("F8"), { state: "quarantined" })).toBe(true);
  expect(isToldByVehicle(trial("F8"), { state: "ready" })).toBe(false);
  expect(isToldByVehicle(trial("F8", "gust"), { state: "quarantined" })).toBe(false);
  expect(isToldByVehicle(trial("F6"), { state: "quarantined" })).toBe(false);
});
