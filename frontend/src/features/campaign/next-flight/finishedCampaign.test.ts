import { expect, test } from "vitest";
import { confirmationOf, confirmationText, endingOf, gainsToLoad } from "./finishedCampaign";

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

test("gains are on the vehicle if it holds what the file says, which has six digits", () => {
  const best = { kp: 0.123456789, ki: 0, kd: 82 };
  const found = gainsToLoad(best, { kp: 0.1, ki: 0 }, { kp: 0.123457, ki: 0, kd: 83 });
  expect(found).toEqual([
    { name: "kp", old: 0.1, value: 0.123456789, held: 0.123457, isOnVehicle: true },
    { name: "ki", old: 0, value: 0, held: 0, isOnVehicle: true },
    { name: "kd", old: undefined, value: 82, held: 83, isOnVehicle: false },
  ]);
  expect(gainsToLoad(best, {}, {}).some(({ isOnVehicle }) => isOnVehicle)).toBe(false);
});
