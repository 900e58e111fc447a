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

/** Something could not be verified: what it is, what can still be done, and who ends it. */
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
          Quarantined: do not fly it
        </h2>
        <p>{vehicle.concern}</p>
      </div>
      <p>
        It is only observed now. Land it if it flies, stop its motors if they still turn on the ground, look at it, then
        release it.
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
          label="Who has looked at it, and what was found"
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
