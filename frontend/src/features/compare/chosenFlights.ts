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

/** The URL of these flights, and of the campaign whose flights are listed first. */
export function paramsOf(trials: readonly number[], campaign: string | null): URLSearchParams {
  const listed: [string, string][] = campaign === null ? [] : [["campaign", campaign]];
  return new URLSearchParams([...listed, ...trials.map((trial): [string, string] => ["trial", String(trial)])]);
}

export function remember(trials: readonly number[]): void {
  sessionStorage.setItem(KEY, trials.join(" "));
}

export function remembered(): number[] {
  return idsIn((sessionStorage.getItem(KEY) ?? "").split(" "));
}

/** Remove the flight if it is selected, otherwise append it. */
export function toggled(trials: readonly number[], trial: number): number[] {
  return trials.includes(trial) ? trials.filter((one) => one !== trial) : [...trials, trial];
}

/** The flights that are not refused by name (`trial.2`). */
export function withoutRefused(trials: readonly number[], problem: Problem | null): number[] {
  const refused = new Set(problem?.problems.map(({ field }) => field));
  return trials.filter((_, index) => !refused.has(`trial.${index}`));
}

/** Comparison of a flight with the first; null for the first itself. */
export function againstFirst(pairs: readonly FlightPair[], first: number, trial: number): FlightPair | null {
  return pairs.find((pair) => pair.against_id === first && pair.trial_id === trial) ?? null;
}
