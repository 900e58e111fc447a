import { expect, test } from "vitest";
import { ApiError, otherProblems, problemFrom, problemOf, reasonsByField, retries } from "./problems";

const refused = problemFrom(422, {
  title: "These gains cannot be flown.",
  detail: "kp is out of bounds.",
  hint: "Correct the named gains.",
  problems: [
    { field: "gains.kp", reason: "must lie in 0 … 4000 counts, got -1" },
    { field: "definition.stop.max_flights", reason: "must be 1 … 200" },
    { field: 7, reason: "not a problem at all" },
  ],
});

test("a refusal keeps its hint and its readable field problems", () => {
  expect(refused.hint).toBe("Correct the named gains.");
  expect(refused.problems.map((one) => one.field)).toEqual(["gains.kp", "definition.stop.max_flights"]);
});

test("a reason finds the input it belongs to, the most precise one first", () => {
  expect(reasonsByField(refused, ["kp", "ki", "stop", "stop.max_flights"])).toEqual({
    kp: "must lie in 0 … 4000 counts, got -1",
    "stop.max_flights": "must be 1 … 200",
  });
});

test("a reason without an input is still shown", () => {
  expect(otherProblems(refused, ["kp"])).toEqual([{ field: "definition.stop.max_flights", reason: "must be 1 … 200" }]);
});

test("a server that is away is told apart from a refusal", () => {
  expect(problemFrom(undefined, undefined).status).toBe(0);
  expect(problemOf(new ApiError(refused))?.status).toBe(422);
  expect(problemOf(new TypeError("Failed to fetch"))?.title).toBe("Failed to fetch");
  expect(problemOf(null)).toBeNull();
});

test("an answer that is no problem document still says something", () => {
  expect(problemFrom(502, "<html>").title).toBe("The server answered 502.");
});

test("a reading is tried again while the server is away, and never after a refusal", () => {
  expect(retries(0, new ApiError(problemFrom(undefined, undefined)))).toBe(true);
  expect(retries(0, new ApiError(problemFrom(503, {})))).toBe(true);
  expect(retries(3, new ApiError(problemFrom(503, {})))).toBe(false);
  expect(retries(0, new ApiError(refused))).toBe(false);
});
