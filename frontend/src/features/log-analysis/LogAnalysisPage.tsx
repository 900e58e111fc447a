import { Button, FileButton, Group, Skeleton, Text, Title } from "@mantine/core";
import { IconFileUpload, IconPlayerPlay } from "@tabler/icons-react";
import { useRef, useState } from "react";
import { ANALYSED_FILES, type AnalysedLog, useAnalyzeLog } from "../../api/logAnalyses";
import { recordOf } from "../../api/records";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { useTitle } from "../../ui/useTitle";
import { Analysis } from "./Analysis";
import classes from "./LogAnalysis.module.css";

const EXAMPLE = "Example";

/** What one log tells: better altitude gains, and how well the replica of the controller explains it. */
export function LogAnalysisPage() {
  useTitle("Log analysis");
  const [over, setOver] = useState(false);
  const resetFile = useRef<() => void>(null);
  const { mutate, data, error, variables, isPending } = useAnalyzeLog();
  const name = variables?.files?.file.name ?? EXAMPLE;
  const analyze = (log: AnalysedLog) => !isPending && mutate(log);
  const choose = (chosen: readonly File[]) => {
    const files = recordOf(chosen);
    if (files) analyze({ files });
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
        choose([...event.dataTransfer.files]);
      }}
    >
      <Title order={1}>Log analysis</Title>
      {isPending && (
        <Panel title={name}>
          <p aria-live="polite">Analysing the log. This takes about 10 seconds.</p>
          <Skeleton height={280} mt={12} radius="md" aria-hidden />
        </Panel>
      )}
      {data && variables && (
        <Analysis
          analysis={data}
          files={variables.files}
          onGains={(gains) => analyze({ ...variables, gains })}
          onVehicle={(vehicle) => analyze({ files: variables.files, vehicle })}
        />
      )}
      <Panel
        title={data ? "Analyse another log" : "Better altitude gains from one log"}
        className={over ? classes["over"] : ""}
      >
        <Text maw="90ch" lh={1.45} mb={10}>
          Drop or choose a log. ArduCopter's .bin or PX4's .ulg: a flight in a mode that holds altitude, with climbs and
          descents of about 2 m and 5 s of hover in between; or a .tlog of it in GUIDED or Offboard. Paparazzi: .data
          and .log, or .tlog, of takeoffs to 3 m. Any other flight of a copter is described. Nothing is stored.
        </Text>
        <Text maw="90ch" lh={1.45} mb={10}>
          Every signal of the controller that the log contains is also compared with Gainline's replica of that
          controller. For this alone a trace with a row for every step of the loop will do, .csv or .csv.gz.
        </Text>
        <Group gap={10} mt={12} mb={10}>
          <FileButton multiple accept={ANALYSED_FILES} onChange={choose} resetRef={resetFile}>
            {(props) => (
              <Button {...props} loading={isPending} leftSection={<IconFileUpload size={20} aria-hidden />}>
                Choose log
              </Button>
            )}
          </FileButton>
          <Button
            variant="default"
            disabled={isPending}
            leftSection={<IconPlayerPlay size={18} aria-hidden />}
            onClick={() => analyze({ files: null })}
          >
            Analyse example
          </Button>
        </Group>
        {error !== null && <Text fw={650}>{name}</Text>}
        <ErrorNotice error={error} />
      </Panel>
    </div>
  );
}
