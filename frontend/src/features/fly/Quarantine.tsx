import { Anchor, Button } from "@mantine/core";
import { IconAlertOctagonFilled, IconArrowBarToDown } from "@tabler/icons-react";
import { Link } from "react-router";
import type { Vehicle } from "../../api/types";
import type { useVehicleCommands } from "../../api/vehicleCommands";
import { CommandResult } from "../fleet/MotorsOff";
import classes from "./Fly.module.css";

interface Props {
  vehicle: Vehicle;
  concern: string;
  orders: ReturnType<typeof useVehicleCommands>;
}

/** Reason of the quarantine, the Land command, and a link to the release. */
export function Quarantine({ vehicle, concern, orders }: Props) {
  return (
    <section className={classes["quarantine"]}>
      <div role="alert">
        <h2>
          <IconAlertOctagonFilled size={24} aria-hidden />
          Do not fly
        </h2>
        <p>{concern}</p>
      </div>
      <Button
        size="lg"
        color="red"
        leftSection={<IconArrowBarToDown size={22} aria-hidden />}
        onClick={() => orders.press("land")}
      >
        Land now
      </Button>
      {orders.said?.order === "land" && <CommandResult orders={orders} />}
      <Anchor component={Link} to={`/vehicles/${vehicle.id}`} display="inline-block" py={12}>
        Inspect and release {vehicle.name}
      </Anchor>
    </section>
  );
}
