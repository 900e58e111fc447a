import { expect, test } from "vitest";
import {
  ApiError,
  formProblem,
  inPercent,
  otherProblems,
  problemFrom,
  problemOf,
  reasonsByField,
  retries,
} from "./problems";

const refused = problemFrom(422, {
  title: "These gains cannot be flown.",
  detail: "kp is out of bounds.",
  hint: "Correct the gains listed.",
  problems: [
    { field: "gains.kp", reason: "must be between 0 and 4000 counts, got -1" },
    { field: "definition.stop.max_flights", reason: "must be 1 … 200" },
    { field: 7, reason: "not a problem at all" },
  ],
});

test("a refusal keeps its hint and its readable field problems", () => {
  expect(refused.hint).toBe("Correct the gains listed.");
  expect(refused.problems.map((one) => one.field)).toEqual(["gains.kp", "definition.stop.max_flights"]);
});

test("a reason finds the input it belongs to, the most precise one first", () => {
  expect(reasonsByField(refused, ["kp", "ki", "stop", "stop.max_flights"])).toEqual({
    kp: "must be between 0 and 4000 counts, got -1",
    "stop.max_flights": "must be 1 … 200",
  });
});

test("a reason without an input is still shown", () => {
  expect(otherProblems(refused, ["kp"])).toEqual([{ field: "definition.stop.max_flights", reason: "must be 1 … 200" }]);
});

test("a refusal that names no field stays", () => {
  const conflict = problemFrom(409, { type: "urn:gainline:conflict", title: "Conflict" });
  expect(formProblem(new ApiError(conflict), { name: "Name" }, {})?.title).toBe("Not possible now");
});

test("a server that is away is told apart from a refusal", () => {
  expect(problemFrom(undefined, undefined).status).toBe(0);
  expect(problemOf(new ApiError(refused))?.status).toBe(422);
  expect(problemOf(new TypeError("Failed to fetch"))?.title).toBe("Failed to fetch");
  expect(problemOf(null)).toBeNull();
});

test("an answer that is no problem document still says something", () => {
  expect(problemFrom(502, "<html>").title).toBe("The server returned status 502.");
});

test("a reading is tried again while the server is away, and never after a refusal", () => {
  expect(retries(0, new ApiError(problemFrom(undefined, undefined)))).toBe(true);
  expect(retries(0, new ApiError(problemFrom(503, {})))).toBe(true);
  expect(retries(3, new ApiError(problemFrom(503, {})))).toBe(false);
  expect(retries(0, new ApiError(refused))).toBe(false);
});

test("reasons stay in their order, and sentences are joined by a space", () => {
  const problem = problemFrom(422, {
    problems: [
      { field: "gains.ki", reason: "The step is too large." },
      { field: "gains.ki", reason: "The vehicle can be stuck on the ground." },
      { field: "gains", reason: "The product can wrap." },
    ],
  });
  expect(reasonsByField(problem, ["ki"])["ki"]).toBe("The step is too large. The vehicle can be stuck on the ground.");
});

test("a reason about a share is given in percent", () => {
  expect(inPercent("must be below 1, got 1.01")).toBe("must be below 100\u00a0%, got 101\u00a0%");
  expect(inPercent("must be above 0 and at most 0.5, got -0.07")).toBe(
    "must be above 0\u00a0% and at most 50\u00a0%, got −7\u00a0%",
  );
});

test("a form names the fields that are still marked by their labels, not in the words of the API", () => {
  const labels = { name: "Name", "stop.max_flights": "Maximum flights", "gains.kp": "kp" };
  expect(formProblem(refused, labels)).toMatchObject({
    title: "Correct the marked fields: Maximum flights, kp.",
    detail: "",
    hint: "",
    problems: refused.problems,
  });
  expect(formProblem(refused, { "gains.kp": "kp" })).toBe(refused);
  expect(formProblem(refused, labels, { "gains.kp": "too low" })?.title).toBe("Correct the marked field: kp.");
  expect(formProblem(refused, labels, {})).toBeNull();
});
