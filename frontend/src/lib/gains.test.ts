import { expect, test } from "vitest";
import { gainsInBrackets } from "./gains";

test("a gain set is written in brackets, in its own order", () => {
  expect(gainsInBrackets({ kp: 400, ki: 20, kd: 100 })).toBe("[400 20 100]");
});
