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

/** Something could not be verified: what it is, what can still be done, and who ends it. */
export function Quarantine({ vehicle, concern, orders }: Props) {
  return (
    <section className={classes["quarantine"]}>
      <div role="alert">
        <h2>
          <IconAlertOctagonFilled size={24} aria-hidden />
          Do not fly it
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
      <Anchor component={Link} to={`/vehicles/${vehicle.id}`} className={classes["link"]}>
        Look at {vehicle.name} and release it
      </Anchor>
    </section>
  );
}
