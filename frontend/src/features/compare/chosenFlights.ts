/** Which flights are compared: the address says it, and the tab remembers it while other pages are looked at. */

import type { FlightPair } from "../../api/compare";
import type { Problem } from "../../api/problems";

export const MOST_FLIGHTS = 20;
const KEY = "compared";

function idsIn(texts: readonly string[]): number[] {
  return [...new Set(texts.map(Number).filter((id) => Number.isSafeInteger(id) && id > 0))];
}

/** The flights of an address, in their order, each once. */
export function chosenIn(params: URLSearchParams): number[] {
  return idsIn(params.getAll("trial"));
}

export function paramsOf(trials: readonly number[]): URLSearchParams {
  return new URLSearchParams(trials.map((trial) => ["trial", String(trial)]));
}

export function remember(trials: readonly number[]): void {
  sessionStorage.setItem(KEY, trials.join(" "));
}

export function remembered(): number[] {
  return idsIn((sessionStorage.getItem(KEY) ?? "").split(" "));
}

/** Without a flight that is among them, with it at their end otherwise. */
export function toggled(trials: readonly number[], trial: number): number[] {
  return trials.includes(trial) ? trials.filter((one) => one !== trial) : [...trials, trial];
}

/** The flights that a refusal does not name (`trial.2`). */
export function withoutRefused(trials: readonly number[], problem: Problem | null): number[] {
  const refused = new Set(problem?.problems.map(({ field }) => field));
  return trials.filter((_, index) => !refused.has(`trial.${index}`));
}

/** How a flight stands against the first one; null for the first itself. */
export function againstFirst(pairs: readonly FlightPair[], first: number, trial: number): FlightPair | null {
  return pairs.find((pair) => pair.against_id === first && pair.trial_id === trial) ?? null;
}
