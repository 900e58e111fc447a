import { Anchor, Skeleton, Stack, Text } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import { Link } from "wouter";
import { useActs, useLedger } from "../../api/fleet";
import type { FigureCard, GivenGains, Vehicle } from "../../api/types";
import { useCalibration, useVehicleFigure } from "../../api/vehicles";
import { FigurePanel } from "../../charts/FigurePanel";
import { Aside } from "../../ui/Aside";
import { NOTHING } from "../../ui/format";
import { gainsInBrackets, sameHeld } from "../../ui/gains";
import { ListTable } from "../../ui/ListTable";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { ShowMore } from "../../ui/ShowMore";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";
import { ACTS, PURPOSES } from "./fleet";
import { remarked } from "./VehicleReadings";

/** What is known of the vehicle over all its campaigns: its calibrations and batteries, the gains written to it, and, of
 * a registered one, what people asked of it. */
export function VehicleHistory({ vehicle }: { vehicle: Pick<Vehicle, "id" | "registered" | "safe_gains"> }) {
  return (
    <>
      <CalibrationHistory vehicleId={vehicle.id} />
      <LedgerTable vehicle={vehicle} />
      {vehicle.registered && <RequestList vehicleId={vehicle.id} />}
    </>
  );
}

const isSent = (asked: GivenGains["asked"]) => Object.keys(asked).length > 0;

/** All gain sets written to the vehicle, and the values read back. */
function LedgerTable({ vehicle }: { vehicle: Pick<Vehicle, "id" | "safe_gains"> }) {
  const ledger = useLedger(vehicle.id);
  const lines = ledger.data?.items ?? [];
  const names = Object.keys(vehicle.safe_gains);
  const written = (gains: GivenGains["asked"], differs = false) => (
    <Text span inherit className="quantity" {...(differs && { c: "var(--bad)", fw: 650 })}>
      {gainsInBrackets(gains, names)}
    </Text>
  );
  return (
    <Panel title="Gain history" className={classes["wide"]}>
      <ErrorNotice error={ledger.error} />
      {ledger.isPending && <Skeleton height={120} aria-busy="true" />}
      {ledger.data && lines.length === 0 && <Note>No gains written yet.</Note>}
      {lines.length > 0 && (
        <ListTable
          label="Gain history"
          className={classes["table"]}
          rows={lines}
          keyOf={({ purpose, flight_id, act_id }) => `${purpose} ${flight_id ?? act_id}`}
          columns={[
            { title: "Purpose", cell: (line) => <Purpose line={line} /> },
            {
              title: `Sent ${names.join(", ")}`,
              isText: true,
              cell: ({ asked }) => (isSent(asked) ? written(asked) : NOTHING),
            },
            {
              title: "Read back",
              isText: true,
              cell: ({ read_back, asked }) =>
                read_back === null ? NOTHING : written(read_back, isSent(asked) && !sameHeld(read_back, asked)),
            },
            { title: "Outcome", isText: true, cell: ({ outcome }) => outcome },
          ]}
        />
      )}
      <ShowMore list={ledger} mt={12} />
    </Panel>
  );
}

function Purpose({ line }: { line: GivenGains }) {
  const { campaign_id, trial_id, asked, asked_at, purpose } = line;
  const title = isSent(asked) ? PURPOSES[purpose] : "Found at connection, nothing sent";
  return (
    <>
      {campaign_id !== null && trial_id !== null ? (
        <Anchor component={Link} to={`/campaigns/${campaign_id}/flights/${trial_id}`}>
          {title}
        </Anchor>
      ) : (
        title
      )}
      <small>
        <Time at={asked_at} />
      </small>
    </>
  );
}

/** Requests whose outcome is that of their flight; those without a result are from before it was recorded. */
const OF_FLIGHTS: ReadonlySet<string> = new Set(["stage", "take-off", "unstage", "abort"]);

/** What people asked of the vehicle: who, when, outcome. */
function RequestList({ vehicleId }: { vehicleId: number }) {
  const acts = useActs(vehicleId);
  return (
    <Panel title="Command log" className={classes["wide"]}>
      <ErrorNotice error={acts.error} />
      {acts.isPending && <Skeleton height={120} aria-busy="true" />}
      <ListTable
        label="Command log"
        className={classes["table"]}
        rows={acts.data?.items ?? []}
        keyOf={({ id }) => String(id)}
        columns={[
          { title: "Command", cell: ({ kind, reason }) => remarked(ACTS[kind], reason) },
          {
            title: "Time",
            isText: true,
            cell: ({ requested_at, by }) => remarked(<Time at={requested_at} />, by && `by ${by}`),
          },
          {
            title: "Outcome",
            isText: true,
            cell: ({ kind, result, state, problem }) =>
              remarked(OF_FLIGHTS.has(kind) && result === null ? "requested" : state, problem),
          },
        ]}
      />
      <ShowMore list={acts} mt={12} />
    </Panel>
  );
}

const EMPTY_PX = 96;
const heightOf = (card: FigureCard | undefined, ready: number) => (card?.state === "ready" ? ready : EMPTY_PX);

/** Fitted parameters of the vehicle over its flights, whether they changed, and its batteries. */
function CalibrationHistory({ vehicleId }: { vehicleId: number }) {
  const known = useCalibration(vehicleId);
  const calibration = useVehicleFigure(vehicleId, "calibration");
  const batteries = useVehicleFigure(vehicleId, "batteries");
  const retune = known.data?.retune;
  return (
    <>
      <Stack gap={14} className={classes["wide"]}>
        <ErrorNotice error={known.error} />
        {retune?.due && (
          <Aside tone="warn" display="flex" style={{ gap: 8 }} role="status">
            <IconAlertTriangle size={20} aria-hidden />
            <span>
              <strong>Re-tune due.</strong> {retune.sentence}
            </span>
          </Aside>
        )}
        <FigurePanel
          title="Calibration history"
          card={calibration.data}
          error={calibration.error}
          height={heightOf(calibration.data, 460)}
          note={retune && !retune.due && calibration.data?.state === "ready" ? retune.sentence : undefined}
        />
      </Stack>
      <FigurePanel
        title="Batteries"
        card={batteries.data}
        error={batteries.error}
        height={heightOf(batteries.data, 300)}
        className={classes["wide"]}
      />
    </>
  );
}
