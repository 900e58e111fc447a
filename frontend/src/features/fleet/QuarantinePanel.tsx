import { Button, TextInput } from "@mantine/core";
import { IconAlertOctagonFilled, IconArrowBarToDown } from "@tabler/icons-react";
import { useState } from "react";
import { useReadOnlyReason } from "../../api/access";
import { useRelease } from "../../api/fleet";
import type { Vehicle } from "../../api/types";
import { useVehicleCommands } from "../../api/vehicleCommands";
import { useVehicleStatus } from "../../live/store";
import { ErrorNotice } from "../../ui/ErrorNotice";
import classes from "./Fleet.module.css";
import { MotorsOff } from "./MotorsOff";

/** Reason of the quarantine, the remaining commands, and the release. */
export function QuarantinePanel({ vehicle }: { vehicle: Vehicle }) {
  const [statement, setStatement] = useState("");
  const status = useVehicleStatus(vehicle.id);
  const orders = useVehicleCommands(vehicle.id);
  const release = useRelease(vehicle.id);
  const watching = useReadOnlyReason(vehicle) !== null;
  return (
    <section className={classes["quarantine"]}>
      <div role="alert">
        <h2>
          <IconAlertOctagonFilled size={24} aria-hidden />
          Quarantined: do not fly
        </h2>
        <p>{vehicle.concern}</p>
      </div>
      <p>
        Gainline sends it no commands except Land and Motors off. Land it, stop its motors, inspect it, then release it.
      </p>
      <div className={classes["row"]}>
        <Button
          size="lg"
          color="red"
          leftSection={<IconArrowBarToDown size={22} aria-hidden />}
          onClick={() => orders.press("land")}
        >
          Land now
        </Button>
        <MotorsOff vehicle={vehicle} status={status} orders={orders} watching={watching} />
      </div>
      <form
        className={classes["row"]}
        onSubmit={(event) => {
          event.preventDefault();
          release.mutate(statement.trim());
        }}
      >
        <TextInput
          label="Inspected by, and findings"
          value={statement}
          maxLength={500}
          onChange={(event) => setStatement(event.currentTarget.value)}
        />
        <Button type="submit" variant="default" disabled={statement.trim() === ""} loading={release.isPending}>
          Release
        </Button>
      </form>
      <ErrorNotice error={release.error} />
    </section>
  );
}
