import { Button, Group, SimpleGrid, Text, Title, useComputedColorScheme } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import type { ReactNode } from "react";
import type { LogAnalysis, Refusal, ReplicaAnswer, TuningAnswer } from "../../api/logAnalyses";
import type { RecordFiles } from "../../api/records";
import type { FigureCard } from "../../api/types";
import { FigurePanel } from "../../charts/FigurePanel";
import { DataTable } from "../../ui/DataTable";
import { gainText, stopped } from "../../ui/format";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { StartCampaign } from "./StartCampaign";

const FIGURE_HEIGHT_PX = 560;
const ROW_PX = 37;

interface Props {
  analysis: LogAnalysis;
  /** Null: the example. */
  files: RecordFiles | null;
  /** Analyse the log again with these gains, `KP,KI,KD`. */
  onGains: (gains: string) => void;
}

/** The answers of a log. What it does not answer comes last, with the reason. */
export function Analysis({ analysis, files, onGains }: Props) {
  const { file_name, autopilot, tuning, replica, figures } = analysis;
  const drawn = figures[useComputedColorScheme("light")] ?? {};
  const parts = [
    isRefusal(tuning) ? (
      <Refused key="tuning" title="No gains from this log" refusal={tuning} />
    ) : (
      <Answer
        key="tuning"
        title="Better gains"
        answer={tuning.answer}
        good={tuning.proposes}
        facts={[["Flight", tuning.flight] as const, ["Vehicle", tuning.vehicle] as const]}
        table={tuning.gains}
        label="Gains compared"
        notes={tuning.notes}
        figures={drawn["tuning"]}
      >
        {files && tuning.starts_campaign && <StartCampaign files={files} experiment={tuning.experiment} />}
        {tuning.parameter_file && <DownloadButton {...tuning.parameter_file} />}
      </Answer>
    ),
    isRefusal(replica) ? (
      <Refused key="replica" title="Not compared with the replica of the controller" refusal={replica} />
    ) : (
      <Answer
        key="replica"
        title="Replica of the controller"
        answer={replica.answer}
        good={replica.agrees}
        facts={[[autopilot, replica.facts] as const]}
        table={replica.table}
        label="Difference of every signal"
        notes={replica.notes}
        figures={drawn["replica"]}
      >
        {files && replica.better_gains && <BetterGains gains={replica.better_gains} onGains={onGains} />}
      </Answer>
    ),
  ];
  return (
    <article className={page["stack"]} aria-label={`Analysis of ${file_name}`}>
      <Title order={2} fz="var(--text-page)">
        {file_name}
      </Title>
      {isRefusal(tuning) ? parts.reverse() : parts}
    </article>
  );
}

function isRefusal(part: TuningAnswer | ReplicaAnswer | Refusal): part is Refusal {
  return "problems" in part;
}

interface AnswerProps {
  title: string;
  answer: string;
  /** Whether the answer is good news. */
  good: boolean;
  facts: readonly (readonly [string, readonly string[]])[];
  table: TuningAnswer["gains"];
  label: string;
  notes: readonly string[];
  figures: readonly FigureCard[] | undefined;
  /** Buttons. */
  children: ReactNode;
}

/** One part of the analysis: its answer in a sentence, facts, table, notes and figures. */
function Answer({ title, answer, good, facts, table, label, notes, figures = [], children }: AnswerProps) {
  const columns = table.columns.map((name) => ({ name, title: name, unit: "", digits: null }));
  return (
    <>
      <Panel title={title}>
        <Text maw="60ch" mb={10} fz="var(--text-page)" fw={650} lh={1.35} c={good ? "var(--best)" : "var(--bad)"}>
          {answer}
        </Text>
        {facts.map(([name, values]) => (
          <Group key={name} component="p" gap="2px 14px" c="dimmed" fz="small">
            <b>{name}</b>
            {values.map((fact) => (
              <span key={fact}>{fact}</span>
            ))}
          </Group>
        ))}
        <DataTable table={{ columns, rows: table.rows }} label={label} height={ROW_PX * (table.rows.length + 1)} />
        <ul className={page["notes"]}>
          {notes.map((note) => (
            <li key={note}>{note}</li>
          ))}
        </ul>
        <Group gap={10} mt="sm">
          {children}
        </Group>
      </Panel>
      <SimpleGrid type="container" cols={{ base: 1, "860px": figures.length }} spacing="var(--gap)">
        {figures.map((card) => (
          // As high on a phone, so that the titles of the axes have room.
          <FigurePanel
            key={card.title}
            title={card.title}
            card={card}
            error={null}
            height={FIGURE_HEIGHT_PX}
            tallest="400vw"
          />
        ))}
      </SimpleGrid>
    </>
  );
}

function Refused({ title, refusal }: { title: string; refusal: Refusal }) {
  return (
    <Panel title={title}>
      <Text maw="90ch">{refusal.title}</Text>
      <ul className={page["notes"]}>
        {refusal.problems.map(({ field, reason }) => (
          <li key={`${field} ${reason}`}>{stopped(field === "file" ? `It ${reason}` : `${field} ${reason}`)}</li>
        ))}
        <li>{refusal.hint}</li>
      </ul>
    </Panel>
  );
}

function DownloadButton({ name, content }: { name: string; content: string }) {
  return (
    <Button
      component="a"
      variant="default"
      href={`data:text/plain;charset=utf-8,${encodeURIComponent(content)}`}
      download={name}
      leftSection={<IconDownload size={18} aria-hidden />}
    >
      Download parameter file
    </Button>
  );
}

function BetterGains({ gains, onGains }: { gains: Record<string, number>; onGains: Props["onGains"] }) {
  const named = Object.entries(gains).map(([name, value]) => `${name} ${gainText(value)}`);
  return (
    <Button variant="default" onClick={() => onGains(Object.values(gains).join(","))}>
      Analyse again with {named.join(", ")}
    </Button>
  );
}
