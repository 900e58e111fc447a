import type { Vehicle } from "../../api/types";
import type { useVehicleCommands } from "../../api/vehicleCommands";
import type { Aged } from "../../live/vehicleStatus";
import { SlideToConfirm } from "../../ui/SlideToConfirm";
import classes from "./MotorsOff.module.css";

interface Props {
  vehicle: Vehicle;
  status: Aged | null;
  orders: ReturnType<typeof useVehicleCommands>;
  /** Whether this browser may only watch the vehicle: then it cannot have it fall. */
  watching?: boolean;
}

/** The last resort, in a corner of its own. */
export function MotorsOff({ vehicle, status, orders, watching = false }: Props) {
  const asked = vehicle.actions.includes("motors off") || status?.status.armed === true;
  const enabled = asked && !watching;
  return (
    <div className={classes["motorsOff"]}>
      <SlideToConfirm
        label="Motors off – the drone falls"
        meaning="Stops the motors at any height."
        disabled={!enabled}
        onConfirm={() => orders.press("motors off")}
      />
      <CommandResult orders={orders} />
    </div>
  );
}

/** What became of the last order, loudly where the vehicle was not told. */
export function CommandResult({ orders: { said } }: { orders: ReturnType<typeof useVehicleCommands> }) {
  if (said === null) return null;
  return (
    <p className={classes["said"]} data-bad={!said.accepted || undefined} role="alert">
      {said.accepted ? said.sentence : `Not told (${said.order}). ${said.sentence}`}
    </p>
  );
}
