/** Analyses of flight logs, which the server does not store. */

import { useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { analyzeLog } from "./generated";
import type { Theme } from "./queries";

export type { AssessedGains, LogAnalysis } from "./generated";

/** The analysis of a file, for as long as the page is open; another theme draws the figure again. */
export function useLogAnalysis(file: File | null, theme: Theme) {
  const identity = file === null ? null : `${file.name} ${file.size} ${file.lastModified}`;
  return useQuery({
    queryKey: ["log analysis", identity, theme],
    queryFn: () => answer(analyzeLog({ query: { theme }, body: { file: file as File } })),
    enabled: file !== null,
    staleTime: Infinity,
    retry: false,
    placeholderData: (previous, query) => (query?.queryKey[1] === identity ? previous : undefined),
  });
}
