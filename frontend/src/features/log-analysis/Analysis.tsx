import { Button, Group, SimpleGrid, Text, Title, useComputedColorScheme } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import type { ReactNode } from "react";
import type { LogAnalysis, PartTexts, TuningAnswer } from "../../api/logAnalyses";
import type { RecordFiles } from "../../api/records";
import type { FigureCard } from "../../api/types";
import { FigurePanel } from "../../charts/FigurePanel";
import { StateBadge } from "../../ui/Badges";
import { DataTable } from "../../ui/DataTable";
import { gainText } from "../../ui/format";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { bad, good, quiet, type StateLabel } from "../../ui/states";
import { Flight } from "./Flight";
import { GainsAsked } from "./GainsAsked";
import { LoggedVehicles } from "./LoggedVehicles";
import { StartCampaign } from "./StartCampaign";

const FIGURE_HEIGHT_PX = 560;
const ROW_PX = 41;
const HEADER_PX = 64;

const GRADES: Record<TuningAnswer["grade"], StateLabel> = {
  full: good("Full answer"),
  partial: quiet("Partial answer"),
  description: quiet("Description only"),
  refused: bad("No answer"),
};

interface Props {
  analysis: LogAnalysis;
  /** Null: the example. */
  files: RecordFiles | null;
  /** Analyse the log again with these gains, `KP,KI,KD`. */
  onGains: (gains: string) => void;
  /** Analyse another vehicle of the log, by its system id. */
  onVehicle: (system: number) => void;
}

/** The answers of a log, as far as it gives them. */
export function Analysis({ analysis, files, onGains, onVehicle }: Props) {
  const { file_name, autopilot, release, frame, vehicle, vehicles, tuning, replica, texts, figures } = analysis;
  const drawn = figures[useComputedColorScheme("light")] ?? {};
  const compared = "signals" in replica;
  const betterGains = compared ? replica.better_gains : null;
  const parts = [
    <Part
      key="tuning"
      title="Gains"
      badge={GRADES[tuning.grade]}
      texts={texts.tuning}
      tone={tuning.proposes ? "var(--best)" : undefined}
      label="Gains compared"
      figures={drawn["tuning"]}
      description={tuning.description && <Flight description={tuning.description} />}
    >
      {files && tuning.starts_campaign && (
        <StartCampaign files={files} experiment={tuning.experiment} loggedVehicle={vehicle} />
      )}
      {texts.tuning.parameter_file && <DownloadButton {...texts.tuning.parameter_file} />}
    </Part>,
    <Part
      key="replica"
      title="Replica of the controller"
      badge={compared ? (replica.agrees ? good("Agrees") : bad("Differs")) : quiet("Not compared")}
      texts={texts.replica}
      tone={compared ? (replica.agrees ? "var(--best)" : "var(--bad)") : undefined}
      label="Difference of every signal"
      figures={drawn["replica"]}
    >
      {files && betterGains && <BetterGains gains={betterGains} onGains={onGains} />}
      {!compared && replica.reasons.some(({ field }) => field === "gains") && (
        <GainsAsked name={file_name} onGains={onGains} />
      )}
    </Part>,
  ];
  return (
    <article className={page["stack"]} aria-label={`Analysis of ${file_name}`}>
      <div>
        <Title order={2} fz="var(--text-page)">
          {file_name}
        </Title>
        <Text c="dimmed">{[autopilot, release, frame].filter(Boolean).join(" · ")}</Text>
        {vehicle !== null && <LoggedVehicles vehicles={vehicles} analysed={vehicle} onVehicle={onVehicle} />}
      </div>
      {tuning.grade === "refused" && compared ? parts.reverse() : parts}
    </article>
  );
}

interface PartProps {
  title: string;
  badge: StateLabel;
  texts: PartTexts;
  /** Colour of the answer, if it is good or bad news. */
  tone: string | undefined;
  label: string;
  figures: readonly FigureCard[] | undefined;
  description?: ReactNode;
  /** Buttons. */
  children: ReactNode;
}

/** One part of the analysis: its answer in a sentence, reasons, flight, facts, table, notes and figures. */
function Part({ title, badge, texts, tone, label, figures = [], description, children }: PartProps) {
  const { answer, reasons, facts, table, notes } = texts;
  return (
    <>
      <Panel title={title} tools={<StateBadge words={badge} />}>
        <Text maw="60ch" mb={10} fz="var(--text-page)" fw={650} lh={1.35} {...(tone && { c: tone })}>
          {answer}
        </Text>
        {reasons.map((reason) => (
          <Text key={reason} maw="90ch" mb={6} lh={1.45}>
            {reason}
          </Text>
        ))}
        {description}
        {facts
          .filter(({ title: name }) => !description || name !== "Whole flight")
          .map(({ title: name, values }) => (
            <Group key={name} component="p" gap="2px 14px" c="dimmed" fz="small">
              <b>{name}</b>
              {values.map((fact) => (
                <span key={fact}>{fact}</span>
              ))}
            </Group>
          ))}
        {table && (
          <DataTable
            table={{ columns: table.columns.map(plainColumn), rows: table.rows }}
            label={label}
            height={ROW_PX * table.rows.length + HEADER_PX}
          />
        )}
        <ul className={page["notes"]}>
          {notes.map((note) => (
            <li key={note}>{note}</li>
          ))}
        </ul>
        <Group gap={10} mt="sm">
          {children}
        </Group>
      </Panel>
      {figures.length > 0 && (
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
      )}
    </>
  );
}

function plainColumn(name: string) {
  return { name, title: name, unit: "", digits: null };
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
