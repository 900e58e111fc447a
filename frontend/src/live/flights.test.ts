import { expect, test } from "vitest";
import { abortStage } from "./flights";

test("an abort is under way only once the worker has accepted it", () => {
  const none = { asked: new Set<number>(), accepted: new Set<number>(), trouble: null };
  const asked = { ...none, asked: new Set([7]) };
  expect(abortStage(7, none)).toBe("none");
  expect(abortStage(7, asked)).toBe("sending");
  expect(abortStage(7, { ...asked, trouble: "The worker does not answer." })).toBe("not sent");
  expect(abortStage(7, { ...asked, accepted: new Set([7]) })).toBe("accepted");
});
