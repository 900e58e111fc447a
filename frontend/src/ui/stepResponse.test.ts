import { expect, test } from "vitest";
import { hasStepResponse, MEASURES, measureText } from "./stepResponse";

const flight = { rise_time_s: 1.341, settling_time_s: null, overshoot_m: 0.147, steady_state_error_m: -0.0033 };

test("each measure prints with its unit, a signed one with its sign, and a missing one as a dash", () => {
  expect(MEASURES.map((measure) => measureText(flight, measure))).toEqual([
    "1.34 s",
    "not settled",
    "0.15 m",
    "−0.003 m",
  ]);
  const aborted = { ...flight, steady_state_error_m: null };
  expect(MEASURES.map((measure) => measureText(aborted, measure))).toEqual(["1.34 s", "–", "0.15 m", "–"]);
  const above = { ...flight, steady_state_error_m: 0.2 };
  expect(MEASURES.map((measure) => measureText(above, measure)).at(-1)).toBe("+0.200 m");
  for (const tiny of [0.0002, -0.0002, 0]) {
    const exact = { ...flight, steady_state_error_m: tiny };
    expect(MEASURES.map((measure) => measureText(exact, measure)).at(-1)).toBe("0.000 m");
  }
});

test("a flight without a step of its set point has no response", () => {
  expect(hasStepResponse(flight)).toBe(true);
  expect(hasStepResponse({ ...flight, overshoot_m: null })).toBe(true);
  expect(hasStepResponse({ ...flight, overshoot_m: null, rise_time_s: null })).toBe(false);
});
