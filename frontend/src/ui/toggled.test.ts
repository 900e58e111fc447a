import { expect, test } from "vitest";
import { toggled } from "./toggled";

test("an item is taken in at the end and left out again", () => {
  expect(toggled([8, 3], 5)).toEqual([8, 3, 5]);
  expect(toggled([8, 3, 5], 3)).toEqual([8, 5]);
});
