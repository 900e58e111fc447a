/** Texts and tables of controller checks. */

import type { ControllerCheckSummary, SignalResult } from "../../api/checks";
import type { FigureTable } from "../../api/types";
import { gainText, NOTHING } from "../../ui/format";
import type { StateLabel } from "../../ui/states";

export const KINDS: Record<ControllerCheckSummary["kind"], string> = {
  log: "Flight log",
  trace: "Step-by-step trace",
};

export function checkStateLabel(passed: boolean): StateLabel {
  return passed ? { word: "Agrees", tone: "good" } : { word: "Differs", tone: "bad" };
}

export function gainsText(gains: Record<string, number>): string {
  return Object.entries(gains)
    .map(([name, value]) => `${name} ${gainText(value)}`)
    .join(", ");
}

/** Integers in full, measured values to two digits. */
function brief(value: number): string {
  return gainText(Number.isInteger(value) ? value : Number(value.toPrecision(2)));
}

function medianText({ median_difference, difference_unit }: SignalResult): string {
  return median_difference === null ? NOTHING : `${brief(median_difference)} ${difference_unit}`;
}

/** Table with one row per signal; with its median difference if that decides. */
export function signalsTable(signals: readonly SignalResult[]): FigureTable {
  const column = (name: string, title: string) => ({ name, title, unit: "", digits: null });
  const areMedians = signals.some(({ median_difference }) => median_difference !== null);
  return {
    columns: [
      column("signal", "Signal"),
      column("difference", "Largest difference"),
      ...(areMedians ? [column("median", "Median difference")] : []),
      column("allowed", areMedians ? "Allowed median" : "Allowed"),
      column("verdict", "Result"),
      column("where", "Differing samples"),
    ],
    rows: signals.map((one) => [
      `${one.name}, ${one.title.toLowerCase()}`,
      `${brief(one.largest_difference)} ${one.difference_unit}`,
      ...(areMedians ? [medianText(one)] : []),
      `${gainText(one.tolerance)} ${one.difference_unit}`,
      one.verdict,
      one.first_different_s === null
        ? NOTHING
        : `${one.different === 1 ? "1 sample, at" : `${one.different} samples, from`} ${one.first_different_s.toFixed(3)} s`,
    ]),
  };
}

/** Allowed differences of the signals: "ff_cmd, fb_cmd, thrust: to the last bit". */
export function allowances(signals: readonly SignalResult[]): string[] {
  const names = new Map<string, string[]>();
  for (const { name, allowance } of signals) names.set(allowance, [...(names.get(allowance) ?? []), name]);
  return [...names].map(([allowance, who]) => `${who.join(", ")}: ${allowance}.`);
}
