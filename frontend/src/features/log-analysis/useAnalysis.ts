import { useWindowEvent } from "@mantine/hooks";
import { useState } from "react";
import { navigate } from "wouter/use-browser-location";
import { type LogToAnalyse, useAnalyzeLog } from "../../api/logAnalyses";
import { recordOf } from "../../api/records";

const EXAMPLE = "Example";

export const logPath = (logId: number): string => `/log-analysis/${logId}`;

/** The analysis of a log that is chosen, or dropped anywhere on the page; then the log's own page opens. */
export function useAnalysis() {
  const [isOver, setOver] = useState(false);
  const { mutate, error, variables, isPending } = useAnalyzeLog();
  const analyze = (log: LogToAnalyse): void => {
    if (!isPending) mutate(log, { onSuccess: ({ analysis }) => navigate(logPath(analysis.log.id)) });
  };
  const choose = (chosen: readonly File[]): void => {
    const files = recordOf(chosen);
    if (files) analyze({ files });
  };
  useWindowEvent("dragover", (event) => {
    event.preventDefault();
    setOver(true);
  });
  useWindowEvent("dragleave", ({ relatedTarget }) => relatedTarget === null && setOver(false));
  useWindowEvent("drop", (event) => {
    event.preventDefault();
    setOver(false);
    choose([...(event.dataTransfer?.files ?? [])]);
  });
  return { analyze, choose, isOver, isPending, error, name: variables?.files?.file.name ?? EXAMPLE };
}

export type OngoingAnalysis = ReturnType<typeof useAnalysis>;
