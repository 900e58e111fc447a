/** Records of flights made elsewhere: which files they are, and what the server asks about them. */

import type { Problem } from "./problems";

/** For the file chooser. A .log goes with Paparazzi's .data file. */
export const RECORD_FILES = ".csv,.tlog,.bin,.ulg,.data,.log,text/csv";

export interface RecordFiles {
  file: File;
  companion?: File;
}

export interface Takeoff {
  number: number;
  summary: string;
}

/** The record among the chosen files, and its companion; null when there is none. */
export function recordOf(files: readonly File[]): RecordFiles | null {
  const isCompanion = (file: File): boolean => file.name.toLowerCase().endsWith(".log");
  const file = files.find((one) => !isCompanion(one)) ?? files[0];
  if (file === undefined) return null;
  const companion = files.find((one) => one !== file && isCompanion(one));
  return { file, ...(companion === undefined ? {} : { companion }) };
}

/** The takeoffs of a log that the server wants one chosen of. */
export function takeoffsIn(problem: Problem | null): Takeoff[] {
  return (problem?.problems ?? []).flatMap(({ field, reason }) => {
    const [, number, summary] = /^(\d+): (.*)$/.exec(reason) ?? [];
    return field === "takeoff" && number !== undefined && summary !== undefined
      ? [{ number: Number(number), summary }]
      : [];
  });
}

/** Whether the log was flown with other gains than planned, which a person has to take or leave. */
export function wantsConfirmation(problem: Problem | null): boolean {
  return (problem?.problems ?? []).some(({ field }) => field === "confirm");
}
