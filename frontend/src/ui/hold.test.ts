import { expect, test } from "vitest";
import { hasArrived, holdProgress, slideShare } from "./HoldButton";

test("a hold counts up to two seconds and is done then, not before", () => {
  const half = holdProgress({ sinceMs: 1000, seenMs: 1950 }, 2000);
  expect(half).toEqual({ kind: "holding", share: 0.5, hold: { sinceMs: 1000, seenMs: 2000 } });
  expect(holdProgress({ sinceMs: 1000, seenMs: 2980 }, 2999).kind).toBe("holding");
  expect(holdProgress({ sinceMs: 1000, seenMs: 2980 }, 3000).kind).toBe("done");
});

test("a page that hung meanwhile does not count what it has not seen", () => {
  expect(holdProgress({ sinceMs: 1000, seenMs: 1100 }, 3000).kind).toBe("broken");
});

test("a knob arrives only when it is slid along its whole track", () => {
  expect(slideShare(20, 120, 200)).toBe(0.5);
  expect([slideShare(20, 0, 200), slideShare(20, 900, 200), slideShare(20, 900, 0)]).toEqual([0, 1, 0]);
  expect([hasArrived(0.9), hasArrived(1)]).toEqual([false, true]);
});
