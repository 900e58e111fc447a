import { expect, test } from "vitest";
import { abortTargets, isWriting } from "./abort";

const flying = [
  { campaignId: 1, trialId: 11 },
  { campaignId: 2, trialId: 22 },
];

test("Space aborts the flight that one looks at", () => {
  expect(abortTargets(flying, 2)).toEqual([{ campaignId: 2, trialId: 22 }]);
});

test("Space aborts everything when the page shows no flight", () => {
  expect(abortTargets(flying, null)).toEqual(flying);
  expect(abortTargets(flying, 7)).toEqual(flying);
  expect(abortTargets([], 7)).toEqual([]);
});

test("a space in a note is a space, on a button it is an abort", () => {
  const number = document.createElement("input");
  number.type = "number";
  const radio = document.createElement("input");
  radio.type = "radio";
  expect(isWriting(document.createElement("textarea"))).toBe(true);
  expect(isWriting(number)).toBe(true);
  expect(isWriting(radio)).toBe(false);
  expect(isWriting(document.createElement("button"))).toBe(false);
  expect(isWriting(null)).toBe(false);
});
