/** Texts of jobs and reproductions: states, durations, progress, comparison with the paper. */

import type { Job, JobState, ReproductionRow } from "../../api/jobs";
import { NOTHING, percentText, trueMinus } from "../../ui/format";
import { bad, busy, good, quiet, type StateLabel } from "../../ui/states";

export const STATE_LABELS: Record<JobState, StateLabel> = {
  queued: quiet("Queued"),
  running: busy("Running"),
  done: good("Done"),
  failed: bad("Failed"),
  cancelled: quiet("Cancelled"),
};

export function isUnderWay({ state }: Pick<Job, "state">): boolean {
  return state === "queued" || state === "running";
}

/** A duration to two figures: "0.4 s", "38 s", "2 min 5 s", "1 h 12 min". */
export function duration(seconds: number): string {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  const whole = Math.round(seconds);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return whole % 60 === 0 ? `${whole / 60} min` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${Math.floor(whole / 3600)} h ${Math.round((whole % 3600) / 60)} min`;
}

export function between(from: string, to: string): string {
  return duration((Date.parse(to) - Date.parse(from)) / 1000);
}

/** Progress of a job: "38 % · jsbsim: 285, 44, 82 flown · about 12 s left". */
export function progressText({ state, done_share: share, doing, remaining_s: left }: Job): string {
  if (state === "queued") return "Queued";
  if (share === null) return "Running";
  const parts = [percentText(Math.floor(100 * share))];
  if (doing !== "") parts.push(doing);
  if (left !== null) parts.push(`about ${duration(Math.max(1, Math.round(left)))} left`);
  return parts.join(" · ");
}

/** Title of a job. `titles` are those of the reproductions by name. */
export function jobTitle({ kind, name }: Job, titles: ReadonlyMap<string, string>): string {
  if (kind === "proposal") return "Proposal";
  if (kind === "landscape") return "Error landscape";
  if (kind === "reproduction") return titles.get(name) ?? name;
  return name === "" ? kind : `${kind} ${name}`;
}

const COMPARED = [
  ["paper", "Paper"],
  ["ratio", "Ratio"],
  ["reference", "Expected"],
] as const;

/** Columns next to our numbers, without empty ones. */
export function comparedColumns(rows: readonly ReproductionRow[]) {
  return COMPARED.filter(([key]) => rows.some((row) => row[key] !== null));
}

/** Range of measured over published in the first group that has any: "0.86 to 1.02 times the published values". */
export function ratioSpan(rows: readonly ReproductionRow[]): string | null {
  const first = rows.find(({ ratio }) => ratio !== null);
  const ratios = rows.flatMap(({ group, ratio }) => (group === first?.group && ratio !== null ? [ratio] : []));
  if (ratios.length === 0) return null;
  const [low, high] = [Math.min(...ratios).toFixed(2), Math.max(...ratios).toFixed(2)];
  return low === high ? `${low} times the published value` : `${low} to ${high} times the published values`;
}

export function measure(value: number | null, digits: number): string {
  return value === null ? NOTHING : trueMinus(value.toFixed(digits));
}
