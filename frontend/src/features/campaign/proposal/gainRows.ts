/** The rows of the table of gains: each gain now and next, its change, its bounds, and what is typed. */

import type { GainSet } from "../../../api/evaluation";
import type { Gain, Proposal } from "../../../api/types";
import { gainText, readNumber } from "../../../ui/format";

export interface GainRow {
  name: string;
  /** Empty until the catalogue is loaded. */
  title: string;
  /** Of the best flight, else of the vehicle's safe gains. */
  now: number;
  /** Null while what is typed is no number. */
  next: number | null;
  /** Null until the catalogue is loaded. */
  bounds: readonly [number, number] | null;
  integer: boolean;
}

/** Each gain now and next, with the campaign's bounds. */
export function gainRows(
  { changes }: Proposal,
  next: Readonly<Record<string, number | null>>,
  known: readonly Gain[],
  bounds: Readonly<Record<string, readonly number[]>>,
): GainRow[] {
  return Object.entries(changes).map(([name, { now }]) => {
    const gain = known.find((one) => one.name === name);
    const [lower = gain?.lower, upper = gain?.upper] = bounds[name] ?? [];
    return {
      name,
      title: gain?.title ?? "",
      now,
      next: next[name] ?? null,
      bounds: lower === undefined || upper === undefined ? null : [lower, upper],
      integer: gain?.integer ?? false,
    };
  });
}

/** `×1.27`, `÷76.3`; the difference where a factor says nothing. */
export function changeText(now: number, next: number): string {
  if (now === next) return "same";
  const factor = next / now;
  const rounded = Number((factor < 1 ? now / next : factor).toPrecision(3));
  if (factor > 0 && Number.isFinite(factor) && rounded !== 1) return `${factor < 1 ? "÷" : "×"}${rounded}`;
  return `${next > now ? "+" : "−"}${gainText(Math.abs(next - now))}`;
}

/** Place of a value within the bounds, in percent from the lower one. */
export function placeIn([lower, upper]: readonly [number, number], value: number): number {
  if (upper === lower) return 0;
  return 100 * Math.min(1, Math.max(0, (value - lower) / (upper - lower)));
}

/** Whether a gain lies outside its bounds, where no prediction means anything. */
export function isOutside({ next, bounds }: Pick<GainRow, "next" | "bounds">): boolean {
  return next !== null && bounds !== null && (next < bounds[0] || next > bounds[1]);
}

/** Step of a slider: a count, or about a five-hundredth of the range. */
export function sliderStep({ integer, bounds }: GainRow): number {
  if (integer || bounds === null || bounds[1] === bounds[0]) return 1;
  return 10 ** Math.floor(Math.log10((bounds[1] - bounds[0]) / 500));
}

/** Typed gains: the numbers, null for what is none, and the reasons. */
export function readGains(texts: Readonly<Record<string, string>>, known: readonly Pick<Gain, "name" | "integer">[]) {
  const isWhole = (name: string) => known.some((gain) => gain.name === name && gain.integer);
  const readings = Object.entries(texts).map(([name, text]) => [name, readNumber(text, isWhole(name))] as const);
  const values: Record<string, number | null> = Object.fromEntries(
    readings.map(([name, { value }]) => [name, value ?? null]),
  );
  const reasons = Object.fromEntries(readings.flatMap(([name, { reason }]) => (reason ? [[name, reason]] : [])));
  const isRead = Object.keys(reasons).length === 0;
  return { values, reasons, gains: isRead ? (values as GainSet) : null };
}
