import { Anchor, Skeleton, Text, Title } from "@mantine/core";
import { Link } from "wouter";
import { useLoggedVehicles, useLogs } from "../../api/logAnalyses";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { ShowMore } from "../../ui/ShowMore";
import { useTitle } from "../../ui/useTitle";
import { LogDrop, Progress } from "./ChooseLog";
import { LogTable, VehicleTable } from "./LogTable";
import { useAnalysis } from "./useAnalysis";

/** The front door for one log, and the library of those analysed before. */
export function LogAnalysisPage() {
  useTitle("Log analysis");
  const analysis = useAnalysis();
  return (
    <div className={page["stack"]}>
      <Title order={1}>Log analysis</Title>
      <Progress analysis={analysis} />
      <LogDrop analysis={analysis} title="Better altitude gains from one log">
        <Text maw="90ch" lh={1.45} mb={10}>
          Drop or choose a log. ArduCopter's .bin or PX4's .ulg: a flight in a mode that holds altitude, with climbs and
          descents of about 2 m and 5 s of hover in between; or a .tlog of it in GUIDED or Offboard. Paparazzi: .data
          and .log, or .tlog, of takeoffs to 3 m. Any other flight of a copter is described.
        </Text>
        <Text maw="90ch" lh={1.45}>
          Every signal of the controller that the log contains is also compared with Gainline's replica of that
          controller. For this alone a trace with a row for every step of the loop will do, .csv or .csv.gz. Every
          flight is searched for{" "}
          <Anchor component={Link} to="/failure-shapes" inherit underline="always">
            shapes of failure
          </Anchor>
          .
        </Text>
      </LogDrop>
      <Vehicles />
      <Logs kept title="Kept logs" none="No log is kept yet. Analyse one, and keep it as a flight of its vehicle." />
      <Logs kept={false} title="Not kept, deleted seven days after their analysis" />
    </div>
  );
}

function Vehicles() {
  const { data = [], error } = useLoggedVehicles();
  if (data.length === 0 && error === null) return null;
  return (
    <Panel title="Vehicles with kept logs">
      <ErrorNotice error={error} />
      <VehicleTable vehicles={data} />
    </Panel>
  );
}

interface LogsProps {
  kept: boolean;
  title: string;
  /** In place of the list if it is empty, which then has no place without it. */
  none?: string;
}

function Logs({ kept, title, none }: LogsProps) {
  const logs = useLogs(kept);
  if (logs.data?.total === 0 && none === undefined) return null;
  return (
    <Panel title={title}>
      <ErrorNotice error={logs.error} />
      {logs.isPending && <Skeleton height={120} aria-busy="true" />}
      {logs.data?.total === 0 && <Note>{none}</Note>}
      {logs.data && logs.data.total > 0 && <LogTable label={title} logs={logs.data.items} />}
      <ShowMore list={logs} mt={12} />
    </Panel>
  );
}
