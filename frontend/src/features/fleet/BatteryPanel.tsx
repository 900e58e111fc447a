import { Button, Stack, TextInput } from "@mantine/core";
import { useState } from "react";
import { useEditVehicle } from "../../api/fleet";
import type { Vehicle } from "../../api/types";
import { useVehicleStatus } from "../../live/store";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { withUnit } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { Panel } from "../../ui/Panel";
import classes from "./Fleet.module.css";

/** Label and voltage of the battery. Every flight stores the label. */
export function BatteryPanel({ vehicle }: { vehicle: Vehicle }) {
  const status = useVehicleStatus(vehicle.id);
  const edit = useEditVehicle(vehicle.id);
  const [typed, setTyped] = useState<string | null>(null);
  const label = typed ?? vehicle.battery;
  return (
    <Panel title="Battery">
      <Stack gap={14}>
        <dl className={`${classes["facts"]} numbers`}>
          <LabelledValue
            title="Voltage now"
            value={withUnit(status?.status.batteryV, "V", 1)}
            stale={!status?.isCurrent}
          />
          <LabelledValue title="Minimum to fly" value={withUnit(Number(vehicle.options["min_battery_v"]), "V", 1)} />
        </dl>
        <form
          className={classes["row"]}
          onSubmit={(event) => {
            event.preventDefault();
            edit.mutate({ version: vehicle.version, battery: label }, { onSuccess: () => setTyped(null) });
          }}
        >
          <TextInput
            label="Battery label"
            placeholder="No. 3"
            value={label}
            maxLength={60}
            disabled={!vehicle.actions.includes("edit")}
            onChange={(event) => setTyped(event.currentTarget.value)}
          />
          <Button type="submit" variant="default" disabled={label === vehicle.battery} loading={edit.isPending}>
            Save
          </Button>
        </form>
        <ErrorNotice error={edit.error} />
      </Stack>
    </Panel>
  );
}
