/** Analyses of flight logs, which the server does not store. */

import { useMutation } from "@tanstack/react-query";
import { answer } from "./client";
import { analyzeExample, analyzeLog, startCampaign } from "./generated";
import type { RecordFiles } from "./records";

export type { Description, LogAnalysis, PartTexts, TuningAnswer } from "./generated";

/** File types of the file chooser. A .log file belongs to Paparazzi's .data file; traces are .csv or .csv.gz. */
export const ANALYSED_FILES = ".bin,.ulg,.tlog,.data,.log,.csv,.gz,text/csv";

interface CampaignStart {
  files: RecordFiles;
  vehicle: number | null;
  loggedVehicle: number | null;
}

/** Create a campaign with the takeoffs of a Paparazzi log, or of a copter with the gains proposed from its log. */
export function useStartCampaign() {
  return useMutation({
    mutationFn: ({ files, vehicle, loggedVehicle }: CampaignStart) =>
      answer(startCampaign({ body: { ...files }, query: { vehicle, logged_vehicle: loggedVehicle } })),
  });
}

export interface AnalysedLog {
  /** Null: the example that comes with Gainline. */
  files: RecordFiles | null;
  /** `KP,KI,KD` as flown, if the log does not contain them. */
  gains?: string;
  /** System id of one of several vehicles; null: the one with the most to learn. */
  vehicle?: number | null;
}

export function useAnalyzeLog() {
  return useMutation({
    mutationFn: ({ files, gains = "", vehicle = null }: AnalysedLog) =>
      answer(files === null ? analyzeExample() : analyzeLog({ body: { ...files }, query: { gains, vehicle } })),
  });
}
