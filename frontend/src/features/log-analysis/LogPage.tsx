import { Group, Title } from "@mantine/core";
import { useParams } from "wouter";
import { type LogAnalysis, useLogAnalysis } from "../../api/logAnalyses";
import { Note } from "../../ui/Note";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { useTitle } from "../../ui/useTitle";
import { Analysis } from "./Analysis";
import { ChooseLog, Progress } from "./ChooseLog";
import { Comparison } from "./Comparison";
import { Downloads } from "./Downloads";
import { LibraryLink, Loaded } from "./Loaded";
import { LogPlacePanel } from "./LogPlacePanel";
import { FlownAt } from "./LogTable";
import { type OngoingAnalysis, useAnalysis } from "./useAnalysis";

/** The stored answer of a log. */
export function LogPage() {
  const logId = Number(useParams()["logId"]);
  const query = useLogAnalysis(logId);
  const analysis = useAnalysis();
  useTitle(query.data?.file_name ?? "Log");
  return (
    <div className={page["stack"]}>
      <Progress analysis={analysis} />
      <Loaded query={query}>{(answer) => <Answer key={logId} answer={answer} analysis={analysis} />}</Loaded>
      <Panel title="Analyse another log">
        <Note mb={12}>Drop it anywhere on this page, or choose it.</Note>
        <ChooseLog analysis={analysis} />
      </Panel>
    </div>
  );
}

function Answer({ answer, analysis }: { answer: LogAnalysis; analysis: OngoingAnalysis }) {
  const { file_name, autopilot, release, frame, log } = answer;
  return (
    <article className={page["stack"]} aria-label={`Analysis of ${file_name}`}>
      <Group justify="space-between" gap="6px 14px">
        <div>
          <LibraryLink />
          <Title order={1}>{file_name}</Title>
          <Note>
            {[autopilot, release, frame].filter(Boolean).join(" · ")} · <FlownAt at={log.flown_at} />
          </Note>
        </div>
        <Downloads log={log} />
      </Group>
      <LogPlacePanel log={log} />
      {log.vehicle && <Comparison log={log} vehicle={log.vehicle} />}
      <Analysis answer={answer} analysis={analysis} />
    </article>
  );
}
