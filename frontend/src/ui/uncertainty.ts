/** Numbers with their uncertainty, in as many digits as it allows: 0.105 ± 0.012 m, not 0.10537 ± 0.0123. */

import type { Interval } from "../api/types";
import { count, NOTHING, percentText, withUnit } from "./format";

const MOST_DIGITS = 6;
/** An uncertainty that begins with less than this carries a second digit: rounding 0.012 to 0.01 would cost too much. */
const TWO_DIGITS_BELOW = 3.55;

/** Digits after the point that an uncertainty of this size allows; three where it is not known. */
export function decimalsOf(uncertainty: number | null | undefined): number {
  if (uncertainty === null || uncertainty === undefined || !(uncertainty > 0) || !Number.isFinite(uncertainty))
    return 3;
  const power = Math.floor(Math.log10(uncertainty));
  const digits = uncertainty / 10 ** power < TWO_DIGITS_BELOW ? 1 - power : -power;
  return Math.min(MOST_DIGITS, Math.max(0, digits));
}

function isNumber(value: number | null | undefined): value is number {
  return value !== null && value !== undefined && Number.isFinite(value);
}

/** `0.105 ± 0.012 m`; the value alone where its uncertainty is not known, a dash where there is none. */
export function plusMinus(
  value: number | null | undefined,
  uncertainty: number | null | undefined,
  unit: string,
): string {
  if (!isNumber(value)) return NOTHING;
  const after = unit === "" ? "" : ` ${unit}`;
  if (!isNumber(uncertainty) || uncertainty <= 0) return `${value.toFixed(3)}${after}`;
  const digits = decimalsOf(uncertainty);
  return `${value.toFixed(digits)} ± ${uncertainty.toFixed(digits)}${after}`;
}

/** `0.093 … 0.118 m`: printed like the errors it is compared with, to three digits. */
export function rangeText({ lower, upper }: Interval, unit: string): string {
  return `${lower.toFixed(3)} … ${withUnit(upper, unit)}`;
}

/** `0.093 … 0.118 m (90 %)`: ± is left to standard errors, an interval always shows both ends and its confidence. */
export function intervalText(interval: Interval, unit: string): string {
  return `${rangeText(interval, unit)} (${percent(interval.confidence)})`;
}

/** A prediction in a line: the number, then its interval. */
export function predictedText(
  value: number | null | undefined,
  interval: Interval | null | undefined,
  unit: string,
): string {
  const text = withUnit(value, unit);
  return isNumber(value) && interval ? `${text}, ${intervalText(interval, unit)}` : text;
}

/** `90 %`. */
export function percent(share: number): string {
  return percentText(100 * share, share > 0.99 && share < 1 ? 1 : 0);
}

/** A confidence as people say it; one that rounds to certainty is not claimed. */
export function confidenceText(confidence: number): string {
  return confidence > 0.995 ? `more than ${percent(0.99)}` : percent(confidence);
}

/** Where the scatter of one flight is known from; `freedom`: its degrees of freedom, null while it is not known. */
export function scatterSource(repeats: number, freedom: number | null): string {
  if (freedom === null)
    return "It was not measured under this autopilot, and no gains have been flown twice: fly a gain set again.";
  const from =
    repeats === 0 ? "Nothing repeated yet: what is known of such flights" : `From ${count(repeats, "repeat")}`;
  return `${from}, worth ${Number(freedom.toFixed(1))} repeats in all.`;
}
