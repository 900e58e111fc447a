import { expect, test } from "vitest";
import { gainsInBrackets, sameHeld } from "./gains";

test("a gain set is written in brackets, in its own order", () => {
  expect(gainsInBrackets({ kp: 400, ki: 20, kd: 100 })).toBe("[400 20 100]");
});

test("a vehicle holds its safe gains when it holds every one of them", () => {
  expect([
    sameHeld({ kp: 1, ki: 2 }, { kp: 1, ki: 2 }),
    sameHeld({ kp: 1 }, { kp: 1, ki: 2 }),
    sameHeld({}, {}),
  ]).toEqual([true, false, false]);
});
