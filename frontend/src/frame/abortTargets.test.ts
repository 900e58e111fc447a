import { expect, test } from "vitest";
import { abortTargets } from "./abortTargets";

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
