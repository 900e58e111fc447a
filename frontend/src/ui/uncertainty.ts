/** Numbers with their uncertainty, rounded to it: 0.105 ± 0.012 m, not 0.10537 ± 0.0123. */

import type { Interval } from "../api/types";
import { errorDigits, NOTHING, percentText, unitAfter, withUnit } from "./format";

const MOST_DIGITS = 6;
/** An uncertainty with a smaller leading digit keeps two digits: rounding 0.012 to 0.01 would lose too much. */
const TWO_DIGITS_BELOW = 3.55;

/** Decimal places for an uncertainty of this size; three if it is unknown. */
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

/** `0.105 ± 0.012 m`; the value alone if its uncertainty is unknown, a dash if there is no value. */
export function plusMinus(
  value: number | null | undefined,
  uncertainty: number | null | undefined,
  unit: string,
): string {
  if (!isNumber(value)) return NOTHING;
  if (!isNumber(uncertainty) || uncertainty <= 0) return withUnit(value, unit);
  const digits = decimalsOf(uncertainty);
  return `${value.toFixed(digits)} ± ${uncertainty.toFixed(digits)}${unitAfter(unit)}`;
}

/** `0.093 … 0.118 m`: printed like the errors it is compared with. */
export function rangeText({ lower, upper }: Interval, unit: string): string {
  const digits = errorDigits(lower, upper);
  return `${lower.toFixed(digits)} … ${withUnit(upper, unit, digits)}`;
}

/** `0.093 … 0.118 m (90 %)`: both ends and the confidence, because ± denotes a standard error. */
export function intervalText(interval: Interval, unit: string): string {
  return `${rangeText(interval, unit)} (${percent(interval.confidence)})`;
}

/** `90 %`. */
export function percent(share: number): string {
  return percentText(100 * share, share > 0.99 && share < 1 ? 1 : 0);
}

export function percentOrNothing(share: number | null): string {
  return share === null ? NOTHING : percent(share);
}

/** A confidence as text; never 100 %. */
export function confidenceText(confidence: number): string {
  return confidence > 0.999 ? `more than ${percent(0.999)}` : percent(confidence);
}
