/** Analyses of flight logs, which the server does not store. */

import { useMutation } from "@tanstack/react-query";
import { answer } from "./client";
import { analyzeLog } from "./generated";

export type { AssessedGains, LogAnalysis } from "./generated";

export function useAnalyzeLog() {
  return useMutation({ mutationFn: (file: File) => answer(analyzeLog({ body: { file } })) });
}
