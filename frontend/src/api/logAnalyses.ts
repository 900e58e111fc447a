/** Analyses of flight logs, which the server does not store. */

import { useMutation } from "@tanstack/react-query";
import { answer } from "./client";
import { analyzeLog, startCampaign } from "./generated";
import type { RecordFiles } from "./records";

export type { LogAnalysis } from "./generated";

/** File types of the file chooser. A .log file belongs to Paparazzi's .data file. */
export const ANALYSED_FILES = ".bin,.ulg,.tlog,.data,.log";

interface CampaignStart {
  files: RecordFiles;
  vehicle: number | null;
}

/** Create a campaign with the takeoffs of a Paparazzi log, or of a copter with the gains proposed from its log. */
export function useStartCampaign() {
  return useMutation({
    mutationFn: ({ files, vehicle }: CampaignStart) =>
      answer(startCampaign({ body: { ...files }, query: { vehicle } })),
  });
}

export function useAnalyzeLog() {
  return useMutation({ mutationFn: (files: RecordFiles) => answer(analyzeLog({ body: { ...files } })) });
}
