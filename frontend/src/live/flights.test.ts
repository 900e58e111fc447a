import { expect, test } from "vitest";
import { ABORT_LABELS, abortReason, abortStage, abortText, isCutShort, stillUnderWay } from "./flights";

test("an abort is under way only once the worker has accepted it", () => {
  const none = { asked: new Set<number>(), accepted: new Set<number>(), trouble: null };
  const asked = { ...none, asked: new Set([7]) };
  expect(abortStage(7, none)).toBe("none");
  expect(abortStage(7, asked)).toBe("sending");
  expect(abortStage(7, { ...asked, trouble: "The worker does not answer." })).toBe("not confirmed");
  expect(abortStage(7, { ...asked, accepted: new Set([7]) })).toBe("accepted");
});

test("a flight that ends without an abort, at a limit or because its link is lost, is not said to be aborting", () => {
  const none = { asked: new Set<number>(), accepted: new Set<number>(), trouble: null };
  const stages = ["record", "abort-land", "link lost"].map((step) => abortStage(7, none, step));
  expect(stages).toEqual(["none", "landing", "link lost"]);
  expect(stages.map((stage) => ABORT_LABELS[stage])).toEqual(["ABORT", "LANDING", "LINK LOST"]);
  expect(abortStage(7, { ...none, asked: new Set([7]) }, "abort-land")).toBe("sending");
});

test("a flight is cut short by an abort that is accepted, or once the vehicle shows it, whichever is known first", () => {
  expect(
    (["none", "sending", "not confirmed", "accepted"] as const).map((stage) => isCutShort(stage, "record")),
  ).toEqual([false, false, false, true]);
  for (const step of ["abort-land", "link lost"]) expect(isCutShort("sending", step)).toBe(true);
});

test("after a link loss nobody is told that safe gains are being sent, and one way on is named", () => {
  const text = abortText("link lost", true, true);
  expect(text).toContain("Land is repeated until the vehicle descends. If it does not descend");
  expect(text).not.toContain("gains");
});

test("only an abort that the worker has accepted is called confirmed once the worker is away", () => {
  expect(abortText("accepted", false, false)).toContain("The abort is confirmed");
  for (const stage of ["none", "landing", "link lost"] as const)
    expect(abortText(stage, false, false)).toMatch(/^The worker cannot be reached\. An abort is sent until/);
});

test("an abort of an earlier attempt is forgotten, so that ABORT of the next one is not labelled as pressed", () => {
  const asked = new Set([7, 8]);
  expect([...stillUnderWay(asked, new Set([8, 9]))]).toEqual([8]);
  expect(stillUnderWay(asked, new Set([7, 8, 9]))).toBe(asked);
});

test("an abort from a tab that is not the operator's says so", () => {
  const control = { operator: "Ada", until: "2026-05-04T10:00:00Z" };
  const real = { is_real: true, registered: true, control };
  const elsewhere = { reason: "aborted from a browser that was not in control" };
  expect(abortReason(real, { operator: "Ada", token: "a" })).toEqual({});
  expect(abortReason(real, { operator: "Ben", token: "b" })).toEqual(elsewhere);
  expect(abortReason(real, undefined)).toEqual(elsewhere);
  expect(abortReason({ ...real, control: null }, undefined)).toEqual(elsewhere);
  expect(abortReason({ ...real, control: null, is_real: false }, undefined)).toEqual({});
  expect(abortReason(undefined, undefined)).toEqual({});
});
