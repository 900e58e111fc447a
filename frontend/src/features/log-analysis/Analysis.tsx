import { Anchor, Button, Group, SimpleGrid, Text, useComputedColorScheme } from "@mantine/core";
import type { ReactNode } from "react";
import { Link } from "wouter";
import { type LogAnalysis, type PartTexts, useSentLog } from "../../api/logAnalyses";
import type { FigureCard } from "../../api/types";
import { FigurePanel } from "../../charts/FigurePanel";
import { Aside } from "../../ui/Aside";
import { StateBadge } from "../../ui/Badges";
import { DataTable } from "../../ui/DataTable";
import { gainText } from "../../ui/format";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { bad, good, quiet, type StateLabel } from "../../ui/states";
import { FileNeeded } from "./ChooseLog";
import { Download } from "./Downloads";
import { Flight } from "./Flight";
import { GainsAsked } from "./GainsAsked";
import { GRADES } from "./readings";
import { StartCampaign } from "./StartCampaign";
import type { OngoingAnalysis } from "./useAnalysis";
import { VehiclesInLog } from "./VehiclesInLog";

const FIGURE_HEIGHT_PX = 560;

interface Props {
  answer: LogAnalysis;
  /** Analyses the log again with other gains, or another vehicle of it. */
  analysis: OngoingAnalysis;
}

/** The answers of a log, as far as it gives them. */
export function Analysis({ answer, analysis }: Props) {
  const { file_name, vehicle, vehicles, tuning, replica, texts, figures, log } = answer;
  const { files } = useSentLog(log.id);
  const { analyze } = analysis;
  const fileNeeded = (what: string) => <FileNeeded analysis={analysis} name={file_name} what={what} />;
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
      {tuning.starts_campaign &&
        (log.starts_campaign || files ? (
          <StartCampaign
            logId={log.id}
            files={log.starts_campaign ? null : files}
            experiment={tuning.experiment}
            loggedVehicle={vehicle}
          />
        ) : (
          fileNeeded("A campaign from these takeoffs")
        ))}
      {texts.tuning.parameter_file && (
        <Download
          href={`data:text/plain;charset=utf-8,${encodeURIComponent(texts.tuning.parameter_file.content)}`}
          name={texts.tuning.parameter_file.name}
        >
          Download parameter file
        </Download>
      )}
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
      {files && betterGains && (
        <BetterGains gains={betterGains} onGains={(gains) => analyze({ files, vehicle, gains })} />
      )}
      {!compared &&
        replica.reasons.some(({ field }) => field === "gains") &&
        (files ? (
          <GainsAsked name={file_name} onGains={(gains) => analyze({ files, vehicle, gains })} />
        ) : (
          fileNeeded("An analysis with other gains")
        ))}
    </Part>,
  ];
  return (
    <>
      {vehicle !== null && (
        <VehiclesInLog
          vehicles={vehicles}
          analysed={vehicle}
          onVehicle={files && ((system) => analyze({ files, vehicle: system }))}
        />
      )}
      {vehicle !== null && !files && fileNeeded("An analysis of another vehicle")}
      {tuning.grade === "refused" && compared ? parts.reverse() : parts}
    </>
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
  const { answer, reasons, facts, shapes = [], table, notes } = texts;
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
        {shapes.map(({ title: name, found, advice }) => (
          <Aside key={name} tone="warn" my={8} maw="90ch">
            <Anchor component={Link} to="/failure-shapes" fw={650}>
              {name}
            </Anchor>
            <p>
              {found} {advice}
            </p>
          </Aside>
        ))}
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
        {table && <DataTable table={{ columns: table.columns.map(plainColumn), rows: table.rows }} label={label} />}
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

function BetterGains({ gains, onGains }: { gains: Record<string, number>; onGains: (gains: string) => void }) {
  const named = Object.entries(gains).map(([name, value]) => `${name} ${gainText(value)}`);
  return (
    <Button variant="default" onClick={() => onGains(Object.values(gains).join(","))}>
      Analyse again with {named.join(", ")}
    </Button>
  );
}
