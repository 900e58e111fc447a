/** Texts of jobs and reproductions: states, durations, progress, comparison with the paper. */

import type { Job, JobState, ReproductionRow } from "../../api/jobs";
import { NOTHING, percentText } from "../../ui/format";
import type { StateLabel } from "../../ui/states";

const JOB: Record<JobState, StateLabel> = {
  queued: { word: "Queued", tone: "quiet" },
  running: { word: "Running", tone: "busy" },
  done: { word: "Done", tone: "good" },
  failed: { word: "Failed", tone: "bad" },
  cancelled: { word: "Cancelled", tone: "quiet" },
};

export function jobStateLabel(state: JobState): StateLabel {
  return JOB[state];
}

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

export function between(from: string | null, to: string | null): string {
  if (from === null || to === null) return NOTHING;
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

/** Link to the result of a job that has no campaign. */
export function jobLink({ kind, name }: Job): string | null {
  return kind === "reproduction" ? `/reproductions#${name}` : null;
}

export interface RowGroup {
  title: string;
  rows: ReproductionRow[];
}

/** Rows grouped by heading, in their original order. */
export function grouped(rows: readonly ReproductionRow[]): RowGroup[] {
  const groups: RowGroup[] = [];
  for (const row of rows) {
    const last = groups.at(-1);
    if (last?.title === row.group) last.rows.push(row);
    else groups.push({ title: row.group, rows: [row] });
  }
  return groups;
}

const COMPARED = [
  ["paper", "Paper"],
  ["ratio", "Ratio"],
  ["reference", "Expected"],
] as const;

export type ComparedColumn = (typeof COMPARED)[number];

/** Columns next to our numbers, without empty ones. */
export function comparedColumns(rows: readonly ReproductionRow[]): ComparedColumn[] {
  return COMPARED.filter(([key]) => rows.some((row) => row[key] !== null));
}

/** Range of measured over published in the first group that has any: "0.86 to 1.02 times the published values". */
export function ratioSpan(rows: readonly ReproductionRow[]): string | null {
  for (const group of grouped(rows)) {
    const ratios = group.rows.flatMap(({ ratio }) => (ratio === null ? [] : [ratio]));
    if (ratios.length === 0) continue;
    const [low, high] = [Math.min(...ratios).toFixed(2), Math.max(...ratios).toFixed(2)];
    return low === high ? `${low} times the published value` : `${low} to ${high} times the published values`;
  }
  return null;
}

export function measure(value: number | null, digits: number): string {
  return value === null ? NOTHING : value.toFixed(digits).replace("-", "−");
}
