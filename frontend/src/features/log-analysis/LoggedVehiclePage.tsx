import { Anchor, Box, Group, Skeleton, Title } from "@mantine/core";
import { Link, useParams } from "wouter";
import {
  type LoggedVehicle,
  type LoggedVehicleDetails,
  useLoggedVehicle,
  useLogsOf,
  useRenameVehicle,
  useTrend,
} from "../../api/logAnalyses";
import { FigurePanel } from "../../charts/FigurePanel";
import type { PlotlyFigure } from "../../charts/traces";
import { Aside } from "../../ui/Aside";
import { count } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { plusMinus } from "../../ui/uncertainty";
import { useTitle } from "../../ui/useTitle";
import fleet from "../fleet/Fleet.module.css";
import { LibraryLink, Loaded } from "./Loaded";
import { LogTable } from "./LogTable";
import { NameForm } from "./NameForm";
import { logPath } from "./useAnalysis";

/** A vehicle whose logs are kept: its trend, what its logs tell together, and each of them. */
export function LoggedVehiclePage() {
  const vehicleId = Number(useParams()["vehicleId"]);
  const query = useLoggedVehicle(vehicleId);
  useTitle(query.data?.name ?? "Vehicle");
  return (
    <div className={page["stack"]}>
      <Loaded query={query}>{(vehicle) => <Vehicle key={vehicleId} vehicle={vehicle} />}</Loaded>
    </div>
  );
}

function Vehicle({ vehicle }: { vehicle: LoggedVehicleDetails }) {
  const { id, name, hardware_id, newest } = vehicle;
  const logs = useLogsOf(id);
  const trend = useTrend(id);
  const all = logs.data ?? [];
  return (
    <>
      <Group justify="space-between" gap="6px 14px">
        <div>
          <LibraryLink />
          <Title order={1} style={{ overflowWrap: "anywhere" }}>
            {name}
          </Title>
          <Note>
            {newest.autopilot} · {count(vehicle.logs, "log")} ·{" "}
            {hardware_id ? `hardware id ${hardware_id}` : "no hardware id"}
          </Note>
        </div>
        <Rename vehicle={vehicle} />
      </Group>
      <FigurePanel title="Trend" card={trend.data} error={trend.error} height={620} tallest="250vw" dressed={plain} />
      <Combined vehicle={vehicle} />
      <Panel title="Logs">
        <ErrorNotice error={logs.error} />
        {logs.isPending && <Skeleton height={120} aria-busy="true" />}
        {logs.data && (
          <LogTable
            label={`Logs of ${name}`}
            logs={all}
            columns={[
              {
                title: "With the one before",
                isText: true,
                cell: (log) =>
                  log !== all.at(-1) && (
                    <Anchor component={Link} to={logPath(log.id)}>
                      Compare
                    </Anchor>
                  ),
              },
            ]}
          />
        )}
      </Panel>
    </>
  );
}

/** Without the legend: the axes say the same. */
const plain = (figure: PlotlyFigure): PlotlyFigure => ({ ...figure, layout: { ...figure.layout, showlegend: false } });

/** The vehicle that all logs fit together. */
function Combined({ vehicle: { combined } }: { vehicle: LoggedVehicleDetails }) {
  if (combined === null) return null;
  const { hover_throttle, thrust_slope, motor_lag_s, drag_1_s } = combined;
  const values = [
    ["Hover throttle", hover_throttle, "", 1],
    ["Thrust slope", thrust_slope, "", 1],
    ["Motor lag", motor_lag_s, "ms", 1000],
    ["Drag", drag_1_s, "1/s", 1],
  ] as const;
  return (
    <Panel title={`The vehicle, fitted to ${count(combined.logs, "log")} together`}>
      <Box component="dl" className={fleet["facts"]}>
        {values.map(([title, { mean, deviation }, unit, scale]) => (
          <LabelledValue key={title} title={title} value={plusMinus(scale * mean, scale * deviation, unit)} />
        ))}
      </Box>
      {!combined.is_one_vehicle && (
        <Aside tone="bad" role="status">
          The thrust slopes of these logs differ: propellers, motors or battery may have changed, and these values are
          those of no vehicle.
        </Aside>
      )}
      <Note mt={12} fz="small">
        ± is one standard deviation; that of the hover throttle is from flight to flight.
      </Note>
    </Panel>
  );
}

function Rename({ vehicle: { id, name } }: { vehicle: LoggedVehicle }) {
  const rename = useRenameVehicle(id);
  return (
    <details key={name}>
      <summary>Rename</summary>
      <NameForm
        label="Name"
        name={name}
        submit="Save"
        mutation={rename}
        onSubmit={(entered) => rename.mutate(entered)}
      />
    </details>
  );
}
