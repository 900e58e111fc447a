/** Measures of a takeoff beside its error. */

import type { Topic } from "./explanations";
import { NOTHING } from "./format";

export interface StepResponse {
  rise_time_s: number | null;
  settling_time_s: number | null;
  overshoot_m: number | null;
  steady_state_error_m: number | null;
}

interface Measure {
  name: keyof StepResponse;
  title: string;
  unit: string;
  topic: Topic;
  digits: number;
}

export const MEASURES: readonly Measure[] = [
  { name: "rise_time_s", title: "Rise time", unit: "s", topic: "riseTime", digits: 2 },
  { name: "settling_time_s", title: "Settling time", unit: "s", topic: "settlingTime", digits: 2 },
  { name: "overshoot_m", title: "Overshoot", unit: "m", topic: "overshoot", digits: 2 },
  { name: "steady_state_error_m", title: "Steady-state error", unit: "m", topic: "steadyStateError", digits: 3 },
];

/** Whether the flight has a step response: not without a record, nor with a set point of zero, nor if it ended during
 * the climb. */
export function hasStepResponse(flight: StepResponse): boolean {
  return flight.overshoot_m !== null || flight.rise_time_s !== null;
}

/** `+0.012 m` for a signed measure, `1.34 s` for others; a dash if there is none. A complete flight may not settle. */
export function measureText(flight: StepResponse, { name, unit, digits }: Measure): string {
  const value = flight[name];
  if (value === null) {
    return name === "settling_time_s" && flight.steady_state_error_m !== null ? "not settled" : NOTHING;
  }
  const size = Math.abs(value).toFixed(digits);
  const isSigned = name === "steady_state_error_m" && Number(size) !== 0;
  return `${value < 0 && Number(size) !== 0 ? "−" : isSigned ? "+" : ""}${size} ${unit}`;
}
