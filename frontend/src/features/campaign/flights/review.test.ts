import { expect, test } from "vitest";
import type { Trial } from "../../../api/types";
import { abortSentence, abortWords, consequenceOf, otherClasses, standingWithout, suggestedClass } from "./review";

const trial = (number: number, state: Trial["state"], error: number | null) =>
  ({
    id: number,
    number,
    state,
    error,
    gains: { kp: number },
    actions: ["classify"],
    may_be_valid: true,
  }) as unknown as Trial;

const first = trial(1, "valid", 0.3267);
const glitch = trial(2, "invalid", 0.05);
const third = trial(3, "valid", 0.1873);
const all = [first, glitch, third, trial(4, "planned", null)];

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
