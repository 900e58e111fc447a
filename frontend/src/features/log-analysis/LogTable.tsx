import { Anchor } from "@mantine/core";
import { Link } from "wouter";
import type { AnalysedLog, LoggedVehicle } from "../../api/logAnalyses";
import { StateBadge } from "../../ui/Badges";
import { type Column, ListTable } from "../../ui/ListTable";
import { Time } from "../../ui/Time";
import { GRADES, QUANTITIES, quantityText } from "./readings";
import { logPath } from "./useAnalysis";

/** When the log was flown, as far as it tells. */
export function FlownAt({ at }: { at: string | null }) {
  return at === null ? "date unknown" : <Time at={at} />;
}

export function VehicleLink({ vehicle: { id, name } }: { vehicle: { id: number; name: string } }) {
  return (
    <Anchor component={Link} to={`/log-analysis/vehicles/${id}`}>
      {name}
    </Anchor>
  );
}

function numbersOf<Row>(logOf: (row: Row) => AnalysedLog): Column<Row>[] {
  return QUANTITIES.map((quantity) => ({
    title: quantity.title,
    cell: (row) => quantityText(quantity, logOf(row).numbers),
  }));
}

const LOG: Column<AnalysedLog> = {
  title: "Log",
  isHeading: true,
  cell: ({ id, file_name, flown_at }) => (
    <span>
      <Anchor component={Link} to={logPath(id)} style={{ overflowWrap: "anywhere" }}>
        {file_name}
      </Anchor>
      <small>
        <FlownAt at={flown_at} />
      </small>
    </span>
  ),
};

const VEHICLE: Column<AnalysedLog> = {
  title: "Vehicle",
  isText: true,
  cell: ({ vehicle, autopilot }) => (vehicle ? <VehicleLink vehicle={vehicle} /> : autopilot),
};

interface Props {
  label: string;
  logs: readonly AnalysedLog[];
  /** Columns in place of that of the vehicle. */
  columns?: readonly Column<AnalysedLog>[];
}

export function LogTable({ label, logs, columns = [VEHICLE] }: Props) {
  return (
    <ListTable
      stacks
      label={label}
      rows={logs}
      keyOf={({ id }) => String(id)}
      columns={[
        LOG,
        ...columns,
        { title: "Answer", isText: true, cell: ({ grade }) => <StateBadge words={GRADES[grade]} /> },
        ...numbersOf<AnalysedLog>((log) => log),
      ]}
    />
  );
}

/** The vehicles with kept logs, each with the numbers of its newest. */
export function VehicleTable({ vehicles }: { vehicles: readonly LoggedVehicle[] }) {
  return (
    <ListTable
      stacks
      label="Vehicles with kept logs"
      rows={vehicles}
      keyOf={({ id }) => String(id)}
      columns={[
        { title: "Vehicle", isHeading: true, cell: (vehicle) => <VehicleLink vehicle={vehicle} /> },
        { title: "Autopilot", isText: true, cell: ({ newest }) => newest.autopilot },
        { title: "Logs", cell: ({ logs }) => logs },
        { title: "Newest", isText: true, cell: ({ newest }) => <FlownAt at={newest.flown_at} /> },
        ...numbersOf<LoggedVehicle>(({ newest }) => newest),
      ]}
    />
  );
}
