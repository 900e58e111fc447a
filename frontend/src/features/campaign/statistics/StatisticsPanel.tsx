import { Group, SimpleGrid, Stack, Text } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import type { ReactNode } from "react";
import { useStatistics } from "../../../api/queries";
import type { CampaignStatistics, RepeatGroup } from "../../../api/types";
import { Aside, toneOf } from "../../../ui/Aside";
import type { Topic } from "../../../ui/explanations";
import { count, flightNumbers, sharesText } from "../../../ui/format";
import { gainsInBrackets } from "../../../ui/gains";
import { HelpTip } from "../../../ui/HelpTip";
import { type Column, ListTable } from "../../../ui/ListTable";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { confidenceText, plusMinus } from "../../../ui/uncertainty";
import { VERDICTS } from "../verdict/verdict";
import classes from "./StatisticsPanel.module.css";

/** Statistics of the flights: verdict, scatter, predictions. */
export function StatisticsPanel({ campaignId }: { campaignId: number }) {
  const statistics = useStatistics(campaignId);
  return (
    <Panel title="Statistics">
      <ErrorNotice error={statistics.error} />
      {statistics.isPending && <div style={{ minHeight: 160 }} aria-busy="true" />}
      {statistics.data && statistics.data.groups.length === 0 && (
        <Note>
          Available after the first valid flight: the scatter of the error, whether the best gains are better, and how
          good the predictions are.
        </Note>
      )}
      {statistics.data && statistics.data.groups.length > 0 && <Results {...statistics.data} />}
    </Panel>
  );
}

function Results(all: CampaignStatistics) {
  const { comparison, drift, track_record: record, notes, battery_trend: trend } = all;
  const shown = [comparison, drift, record, trend].map((one) => one?.sentence ?? "");
  return (
    <Group align="start" gap="14px 20px">
      <SimpleGrid flex="1 1 460px" minColWidth="min(250px, 100%)" autoFlow="auto-fit" spacing={12}>
        <Verdict comparison={comparison} unit={all.error_unit} />
        <Scatter {...all} />
        <Predictions record={record} />
      </SimpleGrid>
      <Stack gap={14} flex="999 1 680px">
        <Groups {...all} />
        <Stack component="ul" gap={4} pl={20} c="dimmed" fz="small" lh={1.45}>
          {drift && (
            <li>
              {drift.sentence} <HelpTip topic="drift" />
            </li>
          )}
          {trend && <li>{trend.sentence}</li>}
          {notes
            .filter((note) => !shown.includes(note))
            .map((note) => (
              <li key={note}>{note}</li>
            ))}
        </Stack>
      </Stack>
    </Group>
  );
}

interface FactProps {
  title: string;
  topic?: Topic;
  tone?: "good" | "bad";
  value: string;
  /** What the value is. */
  remark?: string | false;
  children?: ReactNode;
}

/** One result, and what follows from it. */
function Fact({ title, topic, tone, value, remark, children }: FactProps) {
  return (
    <Aside tone={tone} fz="body" lh={1.4}>
      <Text component="h3" c="dimmed" fz="small" fw={550}>
        {title} {topic && <HelpTip topic={topic} />}
      </Text>
      <Text fz="title" fw={650} lh="inherit">
        {value}
        {remark && (
          <Text span ms={8} c="dimmed" fz="small" fw={550}>
            {remark}
          </Text>
        )}
      </Text>
      {children}
    </Aside>
  );
}

function Verdict({ comparison, unit }: { comparison: CampaignStatistics["comparison"]; unit: string }) {
  if (comparison === null) {
    return (
      <Fact title="Best vs. baseline" value="Same gains">
        Nothing to compare: the first flight's gains are the best so far.
      </Fact>
    );
  }
  const { verdict, confidence, difference, standard_error, further } = comparison;
  return (
    <Fact
      title="Best vs. baseline"
      topic="difference"
      tone={toneOf(verdict)}
      value={VERDICTS[verdict].word}
      remark={confidence !== null && `${confidenceText(confidence)} confidence`}
    >
      <span className="quantity">{plusMinus(Math.abs(difference), standard_error, unit)}</span>{" "}
      {difference < 0 ? "lower" : "higher"}
      {verdict === "not known yet" && <Text fw={650}>Fly one of the two gain sets again</Text>}
      {verdict === "unresolved" && further !== null && (
        <Text fw={650}>
          {count(further.best + further.baseline, "more flight")} needed:{" "}
          {sharesText([further.best, "with the best gains"], [further.baseline, "with the first"])}
        </Text>
      )}
    </Fact>
  );
}

function Scatter({ sigma, degrees_of_freedom: freedom, scatter_source: source, error_unit: unit }: CampaignStatistics) {
  return (
    <Fact
      title="Flight-to-flight scatter"
      topic="scatter"
      value={sigma ? plusMinus(sigma, sigma / Math.sqrt(2 * freedom), unit) : sigma === 0 ? "None" : "Not known yet"}
      remark={sigma ? "± standard error" : false}
    >
      {source}
    </Fact>
  );
}

/** What the record says besides the intervals. */
function directionText({ of, agreeing, disagreeing, sentence }: CampaignStatistics["track_record"]): string {
  const changed = agreeing + disagreeing;
  if (of === 0) return sentence;
  return changed === 0
    ? ""
    : `${agreeing} of ${count(changed, "flight")} with new gains changed the error in the predicted direction. Repeats are not counted: they predict no change.`;
}

function Predictions({ record }: { record: CampaignStatistics["track_record"] }) {
  return (
    <Fact
      title="Predictions inside their interval"
      topic="record"
      tone={record.trustworthy ? undefined : "bad"}
      value={record.of === 0 ? "None yet" : `${record.inside} of ${record.of}`}
      remark={record.of > 0 && "90\u00a0% expected"}
    >
      {!record.trustworthy && (
        <Group gap={6} c="error" fw={650}>
          <IconAlertTriangle size={18} aria-hidden /> Gradient unreliable
        </Group>
      )}
      <Note fz="fine" mt={6}>
        {directionText(record)}
      </Note>
    </Fact>
  );
}

/** One row for each gain set. */
function Groups({ groups, error_unit: unit }: CampaignStatistics) {
  const columns: Column<RepeatGroup>[] = [
    {
      title: `[${Object.keys(groups[0]?.gains ?? {}).join(" ")}]`,
      isHeading: true,
      cell: ({ gains }) => gainsInBrackets(gains),
    },
    { title: "Flight no.", cell: ({ trial_numbers }) => flightNumbers(trial_numbers) },
    {
      title: "Mean error ± standard error",
      topic: "standardError",
      cell: ({ mean, standard_error }) => plusMinus(mean, standard_error, unit),
    },
    {
      title: "Role",
      cell: ({ is_best, is_baseline }) =>
        [is_best ? "best" : "", is_baseline ? "baseline" : ""].filter(Boolean).join(", "),
    },
  ];
  return (
    <ListTable
      label="Gain sets flown"
      framed
      className={classes["groups"]}
      columns={columns}
      rows={groups}
      keyOf={({ trial_numbers: [first] }) => String(first)}
      what="gain sets"
      isKept={({ is_best, is_baseline, trial_numbers }) => is_best || is_baseline || trial_numbers.length > 1}
      marks={({ is_best }) => ({ "data-best": is_best || undefined })}
    />
  );
}
