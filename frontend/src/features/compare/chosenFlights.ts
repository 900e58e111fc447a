/** Selection of compared flights: in the URL, and in the session storage while other pages are open. */

import type { FlightPair } from "../../api/compare";
import type { Problem } from "../../api/problems";

export const MOST_FLIGHTS = 20;
const KEY = "compared";

function idsIn(texts: readonly string[]): number[] {
  return [...new Set(texts.map(Number).filter((id) => Number.isSafeInteger(id) && id > 0))];
}

/** Unique flights of a URL, in order. */
export function chosenIn(params: URLSearchParams): number[] {
  return idsIn(params.getAll("trial"));
}

export function remember(trials: readonly number[]): void {
  sessionStorage.setItem(KEY, trials.join(" "));
}

export function remembered(): number[] {
  return idsIn((sessionStorage.getItem(KEY) ?? "").split(" "));
}

/** The flights that are not refused by name (`trial.2`). */
export function withoutRefused(trials: readonly number[], problem: Problem | null): number[] {
  return trials.filter((_, index) => !problem?.problems.some(({ field }) => field === `trial.${index}`));
}

/** Comparison of a flight with the first; null for the first itself. */
export function againstFirst(pairs: readonly FlightPair[], first: number, trial: number): FlightPair | null {
  return pairs.find((pair) => pair.against_id === first && pair.trial_id === trial) ?? null;
}
