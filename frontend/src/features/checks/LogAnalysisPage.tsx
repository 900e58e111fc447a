import { Anchor, Button, FileButton, Group, Skeleton, Text, Title, useComputedColorScheme } from "@mantine/core";
import { IconDownload, IconFileUpload } from "@tabler/icons-react";
import { useRef, useState } from "react";
import { Link, useNavigate } from "react-router";
import { ANALYSED_FILES, type LogAnalysis, useAnalyzeLog, useStartCampaign } from "../../api/logAnalyses";
import { type RecordFiles, recordOf } from "../../api/records";
import { useVehicles } from "../../api/vehicles";
import { FigurePanel } from "../../charts/FigurePanel";
import { DataTable } from "../../ui/DataTable";
import { SelectField } from "../../ui/Fields";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import row from "../../ui/RowCard.module.css";
import { useTitle } from "../../ui/useTitle";
import classes from "./Checks.module.css";

const FIGURE_HEIGHT_PX = 560;
const ROW_PX = 37;

/** Better altitude gains from the log of a flight, without a campaign. */
export function LogAnalysisPage() {
  useTitle("Log analysis");
  const [over, setOver] = useState(false);
  const resetFile = useRef<() => void>(null);
  const [shown, setShown] = useState<ResultProps | null>(null);
  const { mutate, error, variables, isPending } = useAnalyzeLog();
  const analyze = (files: readonly File[]) => {
    const chosen = recordOf(files);
    if (chosen && !isPending) {
      setShown(null);
      mutate(chosen, { onSuccess: (analysis) => setShown({ analysis, files: chosen }) });
    }
    resetFile.current?.();
  };
  return (
    // biome-ignore lint/a11y/noStaticElementInteractions: dropping a file is a shortcut for the button below
    <div
      className={page["stack"]}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => {
        event.preventDefault();
        setOver(false);
        analyze([...event.dataTransfer.files]);
      }}
    >
      <Title order={1}>Log analysis</Title>
      {isPending && (
        <Panel title={variables.file.name}>
          <p aria-live="polite">Analysing the log. This takes about 10 seconds.</p>
          <Skeleton height={280} mt={12} radius="md" aria-hidden />
        </Panel>
      )}
      {shown && <Result {...shown} />}
      <Panel
        title={shown ? "Analyse another log" : "Better altitude gains from one log"}
        className={over ? classes["over"] : ""}
      >
        <Text maw="90ch" lh={1.45} mb={10}>
          Drop or choose a log. ArduCopter's .bin or PX4's .ulg: a flight in a mode that holds altitude, with climbs and
          descents of about 2 m and 5 s of hover in between; or a .tlog of it in GUIDED or Offboard. Paparazzi: .data
          and .log, or .tlog, of takeoffs to 3 m. Nothing is stored.
        </Text>
        <Group gap={10} mt={12} mb={10}>
          <FileButton multiple accept={ANALYSED_FILES} onChange={analyze} resetRef={resetFile}>
            {(props) => (
              <Button {...props} loading={isPending} leftSection={<IconFileUpload size={20} aria-hidden />}>
                Choose log
              </Button>
            )}
          </FileButton>
        </Group>
        {error !== null && <Text fw={650}>{variables?.file.name}</Text>}
        <ErrorNotice error={error} />
        <Text size="sm" c="dimmed">
          To compare a log with the replica of its controller, use the{" "}
          <Anchor component={Link} to="/controller" inherit underline="always">
            controller check
          </Anchor>
          .
        </Text>
      </Panel>
    </div>
  );
}

interface ResultProps {
  analysis: LogAnalysis;
  files: RecordFiles;
}

function Result({ analysis, files }: ResultProps) {
  const { file_name, answer, proposes, flight, vehicle, gains, notes, parameter_file, figures } = analysis;
  const figure = figures[useComputedColorScheme("light")];
  const columns = gains.columns.map((title) => ({ name: title, title, unit: "", digits: null }));
  return (
    <article className={classes["check"]} aria-label={`Analysis of ${file_name}`}>
      <Panel title={file_name}>
        <p className={classes["sentence"]} data-passed={proposes || undefined}>
          {answer}
        </p>
        <Facts title="Flight" facts={flight} />
        <Facts title="Vehicle" facts={vehicle} />
        <DataTable
          table={{ columns, rows: gains.rows }}
          label="Gains compared"
          height={ROW_PX * (gains.rows.length + 1)}
        />
        <ul className={page["notes"]}>
          {notes.map((note) => (
            <li key={note}>{note}</li>
          ))}
        </ul>
        <Group gap={10} mt="sm">
          {analysis.starts_campaign && <StartCampaign key={file_name} files={files} experiment={analysis.experiment} />}
          {parameter_file !== null && (
            <Button
              component="a"
              variant="default"
              href={`data:text/plain;charset=utf-8,${encodeURIComponent(parameter_file.content)}`}
              download={parameter_file.name}
              leftSection={<IconDownload size={18} aria-hidden />}
            >
              Download parameter file
            </Button>
          )}
        </Group>
      </Panel>
      {figure && <FigurePanel title={figure.title} card={figure} error={null} height={FIGURE_HEIGHT_PX} />}
    </article>
  );
}

/** Starts a campaign with the takeoffs of the log as its first flights, or with the gains proposed from it. */
function StartCampaign({ files, experiment }: { files: RecordFiles; experiment: string | null }) {
  const { mutate, error, isPending } = useStartCampaign();
  const navigate = useNavigate();
  const [chosen, setChosen] = useState("");
  const flying = (useVehicles().data ?? []).filter(
    ({ registered, experiments }) => registered && experiments.includes(experiment ?? ""),
  );
  const isOpen = flying.length > 1 && chosen === "";
  return (
    <>
      {flying.length > 1 && (
        <SelectField
          aria-label="Vehicle of the log"
          data={[
            { value: "", label: "Vehicle of the log…" },
            ...flying.map(({ id, name }) => ({ value: String(id), label: name })),
          ]}
          value={chosen}
          onChange={setChosen}
        />
      )}
      <Button
        loading={isPending}
        disabled={isOpen}
        onClick={() =>
          mutate(
            { files, vehicle: chosen === "" ? null : Number(chosen) },
            { onSuccess: ({ id }) => void navigate(`/campaigns/${id}`) },
          )
        }
      >
        Start campaign
      </Button>
      <ErrorNotice error={error} />
    </>
  );
}

function Facts({ title, facts }: { title: string; facts: readonly string[] }) {
  return (
    <p className={`${row["facts"]} numbers`}>
      <b>{title}</b>
      {facts.map((fact) => (
        <span key={fact}>{fact}</span>
      ))}
    </p>
  );
}
