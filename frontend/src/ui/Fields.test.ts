import { expect, test } from "vitest";
import { numbersOf, scaled } from "./Fields";

test("a share is entered in percent, to the last digit, and what is no number yet stays as it is typed", () => {
  expect(scaled(0.07, 100)).toBe(7);
  expect(scaled(7.5, 0.01)).toBe(0.075);
  expect(scaled("7,5", 0.01)).toBe("7,5");
  expect(numbersOf({ kp: 283, ki: "1e", kd: "" })).toEqual({ kp: 283 });
});
