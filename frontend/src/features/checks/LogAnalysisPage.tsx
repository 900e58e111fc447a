import { Anchor, Button, FileButton, Group, Skeleton, Text, Title, useComputedColorScheme } from "@mantine/core";
import { IconDownload, IconFileUpload } from "@tabler/icons-react";
import { useRef, useState } from "react";
import { Link } from "react-router";
import { type LogAnalysis, useAnalyzeLog } from "../../api/logAnalyses";
import { FigurePanel } from "../../charts/FigurePanel";
import { DataTable } from "../../ui/DataTable";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import row from "../../ui/RowCard.module.css";
import { useTitle } from "../../ui/useTitle";
import classes from "./Checks.module.css";
import { behaviourOf, gainsTable, vehicleOf } from "./logAnalysis";

const FIGURE_HEIGHT_PX = 560;
const ROW_PX = 37;

/** Better altitude gains from the log of a flight, without a campaign. */
export function LogAnalysisPage() {
  useTitle("Log analysis");
  const [over, setOver] = useState(false);
  const resetFile = useRef<() => void>(null);
  const { mutate, data, error, variables, isPending } = useAnalyzeLog();
  const analyze = (file: File | null | undefined) => {
    if (file && !isPending) mutate(file);
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
        analyze(event.dataTransfer.files[0]);
      }}
    >
      <Title order={1}>Log analysis</Title>
      {isPending && (
        <Panel title={variables.name}>
          <p aria-live="polite">Analysing the log. This takes about 10 seconds.</p>
          <Skeleton height={280} mt={12} radius="md" aria-hidden />
        </Panel>
      )}
      {data && <Result analysis={data} />}
      <Panel
        title={data ? "Analyse another log" : "Better altitude gains from one log"}
        className={over ? classes["over"] : ""}
      >
        <Text maw="90ch" lh={1.45} mb={10}>
          Drop ArduCopter's .bin log of a flight here or choose it. In GUIDED, LOITER, ALT_HOLD or AUTO the vehicle
          should climb and descend by about 2 m with a few seconds of hover between. The file is not stored.
        </Text>
        <Group gap={10} mt={12} mb={10}>
          <FileButton accept=".bin" onChange={analyze} resetRef={resetFile}>
            {(props) => (
              <Button {...props} loading={isPending} leftSection={<IconFileUpload size={20} aria-hidden />}>
                Choose log
              </Button>
            )}
          </FileButton>
        </Group>
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

function Result({ analysis }: { analysis: LogAnalysis }) {
  const { file_name, answer, proposed, at_limit, parameter_file, figures } = analysis;
  const figure = figures[useComputedColorScheme("light")];
  const table = gainsTable(analysis);
  return (
    <article className={classes["check"]} aria-label={`Analysis of ${file_name}`}>
      <Panel title={file_name}>
        <p className={classes["sentence"]} data-passed={proposed !== null || undefined}>
          {answer}
        </p>
        <Facts title="Flight" facts={behaviourOf(analysis)} />
        <Facts title="Vehicle" facts={vehicleOf(analysis)} />
        <DataTable table={table} label="Gains compared" height={ROW_PX * (table.rows.length + 1)} />
        <ul className={page["notes"]}>
          <li>Deviations are predicted for the same manoeuvre in the same weather, other parameters as flown.</li>
          <li>Activity is that of the throttle, relative to the gains flown; a proposal has at most 1.5.</li>
          <li>
            The margin is the factor on P and I of the acceleration controller at which the loop rings with 30 ms more
            lag; a proposal has at least 2.
          </li>
          {at_limit.length > 0 && <li>At an end of the range searched: {at_limit.join(", ")}.</li>}
          {proposed && <li>Load the gains on the ground. Fly them first at a safe height, ready to take over.</li>}
        </ul>
        {parameter_file !== null && (
          <Button
            component="a"
            mt="sm"
            variant="default"
            href={`data:text/plain;charset=utf-8,${encodeURIComponent(parameter_file)}`}
            download={`${file_name.replace(/\.bin$/i, "")}.param`}
            leftSection={<IconDownload size={18} aria-hidden />}
          >
            Download parameter file
          </Button>
        )}
      </Panel>
      {figure && <FigurePanel title={figure.title} card={figure} error={null} height={FIGURE_HEIGHT_PX} />}
    </article>
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
