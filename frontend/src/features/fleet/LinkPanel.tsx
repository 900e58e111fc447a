import { Anchor, Button, Group, Stack, Text, TextInput } from "@mantine/core";
import { type ReactNode, useState } from "react";
import { Link } from "wouter";
import { useActs, useEditVehicle } from "../../api/fleet";
import { useCatalogue } from "../../api/queries";
import type { Vehicle } from "../../api/types";
import { useVehicles } from "../../api/vehicles";
import { useVehicleStatus } from "../../live/store";
import { linkText, lowBattery, messageText, stepWord } from "../../live/vehicleStatus";
import { NOTHING, withUnit } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { percent } from "../../ui/uncertainty";
import classes from "./Fleet.module.css";
import { autopilotTitle, connectFailure, vehicleAtSameAddress } from "./fleet";

function armedText(armed: boolean | null | undefined): string {
  if (armed === null || armed === undefined) return NOTHING;
  return armed ? "armed" : "disarmed";
}

/** Current state of the link and the vehicle's telemetry. */
export function LinkPanel({ vehicle, mayEdit }: { vehicle: Vehicle; mayEdit: boolean }) {
  const aged = useVehicleStatus(vehicle.id);
  const isLinked = vehicle.state !== "disconnected";
  const stale = !(aged?.isCurrent ?? false);
  const status = aged?.status;
  const message = aged === null ? null : messageText(aged);
  const { identity } = vehicle;
  const { data: catalogue } = useCatalogue();
  const readings = {
    Activity: status === undefined ? NOTHING : stepWord(status.step),
    Motors: armedText(status?.armed),
    Mode: status?.mode || NOTHING,
    Altitude: withUnit(status?.altitudeM, "m", 2),
    "Position rate": withUnit(status?.positionHz, "Hz", 0),
    "Packet loss": status?.lostShare === null || status === undefined ? NOTHING : percent(status.lostShare),
  };
  return (
    <Panel
      title="Connection"
      tools={
        mayEdit && (
          <Button component={Link} to={`/vehicles/${vehicle.id}/edit`} variant="default">
            Edit
          </Button>
        )
      }
    >
      <Stack gap={14}>
        {isLinked ? (
          <dl className={classes["facts"]}>
            <LabelledValue title="Link age" topic="linkAge" value={linkText(aged)} bad={stale} />
            {Object.entries(readings).map(([title, value]) => (
              <LabelledValue key={title} title={title} value={value} stale={stale} />
            ))}
          </dl>
        ) : (
          <NotConnected vehicle={vehicle} />
        )}
        {message !== null && <Note>{message}</Note>}
        {status?.trouble && <Trouble>{status.trouble}</Trouble>}
        <Note>
          {autopilotTitle(catalogue, vehicle)} at {String(vehicle.options["address"] ?? "")}
          {identity !== null && `; identified as system ${identity.system_id}`}
          {identity?.version && `, version ${identity.version}`}
          {identity?.uid && `, hardware id ${identity.uid}`}
        </Note>
      </Stack>
    </Panel>
  );
}

function Trouble({ children }: { children: ReactNode }) {
  return (
    <Text c="var(--bad)" fw={650}>
      {children}
    </Text>
  );
}

/** What connecting does, and why it has not succeeded yet. */
function NotConnected({ vehicle }: { vehicle: Vehicle }) {
  const acts = useActs(vehicle.id).data?.items ?? [];
  const isWanted = vehicle.actions.includes("disconnect");
  const other = vehicleAtSameAddress(vehicle, useVehicles().data ?? []);
  const failure = connectFailure(acts);
  return (
    <>
      {other !== null && (
        <Trouble>
          <Anchor component={Link} to={`/vehicles/${other.id}`} fw="inherit">
            {other.name}
          </Anchor>{" "}
          uses the same local port: disconnect it, or change this address.
        </Trouble>
      )}
      {failure && other === null && <Trouble>The last request failed. {failure}</Trouble>}
      <Note>
        {isWanted ? `Connecting${failure ? "" : ": no vehicle has answered yet"}. ` : "Not connected. "}
        {vehicle.identity === null
          ? "Connecting compares the vehicle's gains with the safe gains and changes nothing."
          : "Connecting writes the safe gains and reads them back. The vehicle does not move."}
      </Note>
    </>
  );
}

/** Label and voltage of the battery. Every flight stores the label. */
export function BatteryPanel({ vehicle }: { vehicle: Vehicle }) {
  const status = useVehicleStatus(vehicle.id);
  const low = lowBattery(vehicle, status?.status.batteryV);
  const edit = useEditVehicle(vehicle.id);
  const [typed, setTyped] = useState<string | null>(null);
  const label = typed ?? vehicle.battery;
  return (
    <Panel title="Battery">
      <Stack gap={14}>
        <dl className={classes["facts"]}>
          <LabelledValue
            title={low === "" ? "Voltage" : `Voltage, ${low}`}
            value={withUnit(status?.status.batteryV, "V", 1)}
            stale={!status?.isCurrent}
            bad={low !== "" && status?.isCurrent === true}
          />
          <LabelledValue title="Minimum to fly" value={withUnit(Number(vehicle.options["min_battery_v"]), "V", 1)} />
        </dl>
        <form
          action={() => edit.mutate({ version: vehicle.version, battery: label }, { onSuccess: () => setTyped(null) })}
        >
          <Group gap={10} align="flex-end">
            <TextInput
              label="Battery label"
              placeholder="No. 3"
              flex="1 1 180px"
              value={label}
              maxLength={60}
              disabled={!vehicle.actions.includes("edit")}
              onChange={(event) => setTyped(event.currentTarget.value)}
            />
            <Button type="submit" variant="default" disabled={label === vehicle.battery} loading={edit.isPending}>
              Save label
            </Button>
          </Group>
        </form>
        <ErrorNotice error={edit.error} />
      </Stack>
    </Panel>
  );
}
