import { Anchor, Button, Skeleton, Stack, useComputedColorScheme } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import { Link } from "wouter";
import { useActs, useLedger } from "../../api/fleet";
import type { FigureCard, GivenGains, Vehicle } from "../../api/types";
import { useCalibration, useVehicleFigure } from "../../api/vehicles";
import { FigurePanel } from "../../charts/FigurePanel";
import { Aside } from "../../ui/Aside";
import { NOTHING } from "../../ui/format";
import { gainsInBrackets, sameHeld } from "../../ui/gains";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { addPage } from "../../ui/paging";
import { ScrollTable } from "../../ui/ScrollTable";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";
import { ACTS, purposeOf } from "./fleet";

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

/** All gain sets written to the vehicle, and the values read back. */
function LedgerTable({ vehicle }: { vehicle: Pick<Vehicle, "id" | "safe_gains"> }) {
  const ledger = useLedger(vehicle.id);
  const lines = ledger.data?.pages.flatMap((page) => page.items) ?? [];
  const names = Object.keys(vehicle.safe_gains);
  return (
    <Panel title="Gain history" className={classes["wide"]}>
      <ErrorNotice error={ledger.error} />
      {ledger.isPending && <Skeleton height={120} aria-busy="true" />}
      {ledger.data && lines.length === 0 && <Note>No gains written yet.</Note>}
      {lines.length > 0 && (
        <ScrollTable label="Gain history" className={classes["table"]}>
          <thead>
            <tr>
              <th scope="col">Purpose</th>
              <th scope="col">Sent {names.join(", ")}</th>
              <th scope="col">Read back</th>
              <th scope="col">Outcome</th>
            </tr>
          </thead>
          <tbody>
            {lines.map((line) => (
              <Line key={`${line.purpose} ${line.flight_id ?? line.act_id}`} line={line} names={names} />
            ))}
          </tbody>
        </ScrollTable>
      )}
      {ledger.hasNextPage && (
        <Button variant="default" mt={12} loading={ledger.isFetchingNextPage} onClick={() => void addPage(ledger)}>
          Show more ({lines.length} of {ledger.data?.pages[0]?.total})
        </Button>
      )}
    </Panel>
  );
}

function Line({ line, names }: { line: GivenGains; names: readonly string[] }) {
  const { campaign_id, trial_id, read_back, asked } = line;
  const isSent = Object.keys(asked).length > 0;
  const differs = read_back !== null && isSent && !sameHeld(read_back, asked);
  return (
    <tr>
      <td>
        {campaign_id !== null && trial_id !== null ? (
          <Anchor component={Link} to={`/campaigns/${campaign_id}/flights/${trial_id}`}>
            {purposeOf(line)}
          </Anchor>
        ) : (
          purposeOf(line)
        )}
        <small>
          <Time at={line.asked_at} />
        </small>
      </td>
      <td className="numbers">{isSent ? gainsInBrackets(asked, names) : NOTHING}</td>
      <td className={`numbers ${differs ? classes["differs"] : ""}`}>
        {read_back === null ? NOTHING : gainsInBrackets(read_back, names)}
      </td>
      <td>{line.outcome}</td>
    </tr>
  );
}

/** Requests whose outcome is that of their flight; those without a result are from before it was recorded. */
const OF_FLIGHTS: ReadonlySet<string> = new Set(["stage", "take-off", "unstage", "abort"]);

/** What people asked of the vehicle: who, when, outcome. */
function RequestList({ vehicleId }: { vehicleId: number }) {
  const acts = useActs(vehicleId);
  const items = acts.data?.pages.flatMap((page) => page.items) ?? [];
  return (
    <Panel title="Command log" className={classes["wide"]}>
      <ErrorNotice error={acts.error} />
      {acts.isPending && <Skeleton height={120} aria-busy="true" />}
      <ScrollTable label="Command log" className={classes["table"]}>
        <thead>
          <tr>
            <th scope="col">Command</th>
            <th scope="col">Time</th>
            <th scope="col">Outcome</th>
          </tr>
        </thead>
        <tbody>
          {items.map((act) => (
            <tr key={act.id}>
              <td>
                {ACTS[act.kind]}
                {act.reason && <small>{act.reason}</small>}
              </td>
              <td>
                <Time at={act.requested_at} />
                {act.by && <small>by {act.by}</small>}
              </td>
              <td>
                {OF_FLIGHTS.has(act.kind) && act.result === null ? "requested" : act.state}
                {act.problem && <small>{act.problem}</small>}
              </td>
            </tr>
          ))}
        </tbody>
      </ScrollTable>
      {acts.hasNextPage && (
        <Button variant="default" mt={12} loading={acts.isFetchingNextPage} onClick={() => void addPage(acts)}>
          Show more ({items.length} of {acts.data?.pages[0]?.total})
        </Button>
      )}
    </Panel>
  );
}

const EMPTY_PX = 96;
const heightOf = (card: FigureCard | undefined, ready: number) => (card?.state === "ready" ? ready : EMPTY_PX);

/** Fitted parameters of the vehicle over its flights, whether they changed, and its batteries. */
function CalibrationHistory({ vehicleId }: { vehicleId: number }) {
  const theme = useComputedColorScheme("light");
  const known = useCalibration(vehicleId);
  const calibration = useVehicleFigure(vehicleId, "calibration", theme);
  const batteries = useVehicleFigure(vehicleId, "batteries", theme);
  const retune = known.data?.retune;
  return (
    <>
      <Stack gap={14} className={classes["wide"] ?? ""}>
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
