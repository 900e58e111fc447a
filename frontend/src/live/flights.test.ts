import { expect, test } from "vitest";
import { abortReason, abortStage, stillUnderWay } from "./flights";

test("an abort is under way only once the worker has accepted it", () => {
  const none = { asked: new Set<number>(), accepted: new Set<number>(), trouble: null };
  const asked = { ...none, asked: new Set([7]) };
  expect(abortStage(7, none)).toBe("none");
  expect(abortStage(7, asked)).toBe("sending");
  expect(abortStage(7, { ...asked, trouble: "The worker does not answer." })).toBe("not confirmed");
  expect(abortStage(7, { ...asked, accepted: new Set([7]) })).toBe("accepted");
});

test("a vehicle that aborts by itself is shown like one whose abort was accepted", () => {
  const none = { asked: new Set<number>(), accepted: new Set<number>(), trouble: null };
  expect(["record", "abort-land", "link lost"].map((step) => abortStage(7, none, step))).toEqual([
    "none",
    "accepted",
    "accepted",
  ]);
  expect(abortStage(7, { ...none, asked: new Set([7]) }, "abort-land")).toBe("sending");
});

test("an abort of an earlier attempt is forgotten, so that ABORT of the next one is not labelled as pressed", () => {
  const asked = new Set([7, 8]);
  expect([...stillUnderWay(asked, new Set([8, 9]))]).toEqual([8]);
  expect(stillUnderWay(asked, new Set([7, 8, 9]))).toBe(asked);
});

test("an abort from a tab that is not the operator's says so", () => {
  const control = { operator: "Ada", until: "2026-05-04T10:00:00Z" };
  const real = { is_real: true, registered: true, control };
  const elsewhere = { reason: "aborted from another browser" };
  expect(abortReason(real, { operator: "Ada", token: "a" })).toEqual({});
  expect(abortReason(real, { operator: "Ben", token: "b" })).toEqual(elsewhere);
  expect(abortReason(real, undefined)).toEqual(elsewhere);
  expect(abortReason({ ...real, control: null }, undefined)).toEqual(elsewhere);
  expect(abortReason({ ...real, control: null, is_real: false }, undefined)).toEqual({});
  expect(abortReason(undefined, undefined)).toEqual({});
});
