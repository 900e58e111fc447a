/** What lists and comparisons show of a log. */

import type { Grade, LogNumbers, ParameterChange } from "../../api/logAnalyses";
import { NOTHING, percentChange, percentText, trueMinus, withUnit } from "../../ui/format";
import { bad, good, quiet, type StateLabel } from "../../ui/states";
import { plusMinus } from "../../ui/uncertainty";

export const GRADES: Record<Grade, StateLabel> = {
  full: good("Full answer"),
  partial: quiet("Partial answer"),
  description: quiet("Description only"),
  refused: bad("No answer"),
};

/** Below 1 m in millimetres. */
export function lengthText(metres: number): string {
  return metres < 1 ? withUnit(1000 * metres, "mm", metres < 0.01 ? 1 : 0) : withUnit(metres, "m", 2);
}

/** The range in which a margin is searched; a flight's is told by its ends beyond them. */
const MARGINS = { least: 1, most: 8 };

function marginText(margin: number): string {
  if (margin < MARGINS.least) return `less than ${MARGINS.least}`;
  return margin >= MARGINS.most ? `at least ${MARGINS.most}` : margin.toFixed(1);
}

/** Nothing below the third decimal: flights differ by more. */
const shownDeviation = (deviation = 0): number | null => (deviation < 0.0005 ? null : deviation);

interface Quantity {
  title: string;
  value: (numbers: LogNumbers) => number | null | undefined;
  text: (value: number, numbers: LogNumbers) => string;
}

export const QUANTITIES: readonly Quantity[] = [
  { title: "Mean deviation", value: ({ deviation_m }) => deviation_m, text: lengthText },
  {
    title: "Hover throttle",
    value: ({ hover_throttle }) => hover_throttle?.mean,
    text: (mean, { hover_throttle }) => plusMinus(mean, shownDeviation(hover_throttle?.deviation), ""),
  },
  {
    title: "Throttle activity",
    value: ({ activity }) => activity,
    text: (share) => percentText(100 * share, share < 0.01 ? 2 : 1),
  },
  { title: "Margin", value: ({ margin }) => margin, text: marginText },
];

export function quantityText({ value, text }: Quantity, numbers: LogNumbers): string {
  const known = value(numbers);
  return known === null || known === undefined ? NOTHING : text(known, numbers);
}

/** `−16 %`, of a factor; from twice as much on `×2.3`. */
export function factorText(factor: number): string {
  const percent = 100 * (factor - 1);
  if (percent > 100) return `×${Number(factor.toPrecision(2))}`;
  const text = trueMinus(percentText(percent, Math.abs(percent) < 10 ? 1 : 0));
  return percent > 0 ? `+${text}` : text;
}

/** The change from another log to this one; none of a margin beyond the range that is searched. */
export function changeText({ value, text }: Quantity, before: LogNumbers, now: LogNumbers): string {
  const [from, to] = [value(before), value(now)];
  const percent = percentChange(to, from);
  const isBeyond = text === marginText && [from, to].some((one) => one === 0 || one === MARGINS.most);
  return percent === null || isBeyond ? NOTHING : factorText(1 + percent / 100);
}

/** A parameter as single precision holds it. */
export function parameterText(value: number | null): string {
  return value === null ? "not in the log" : trueMinus(String(Number(value.toPrecision(7))));
}

const GROUPS: readonly (readonly [ParameterChange["group"], string])[] = [
  ["gain", "Gains"],
  ["loop", "Altitude loop"],
  ["other", "Other parameters"],
  ["self-written", "Written by the autopilot itself"],
  ["unknown", "In one log only"],
];

/** The groups that have parameters, gains first. */
export function parameterGroups(parameters: readonly ParameterChange[]) {
  return GROUPS.map(([group, title]) => ({
    group,
    title,
    parameters: parameters.filter((one) => one.group === group),
  })).filter((one) => one.parameters.length > 0);
}
