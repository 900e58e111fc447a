import type { Vehicle } from "../../api/types";
import type { useVehicleCommands } from "../../api/vehicleCommands";
import type { Aged } from "../../live/vehicleStatus";
import { SlideToConfirm } from "../../ui/SlideToConfirm";
import classes from "./MotorsOff.module.css";

interface Props {
  vehicle: Vehicle;
  status: Aged | null;
  orders: ReturnType<typeof useVehicleCommands>;
  /** Whether this browser has read-only access, which disables the control. */
  watching?: boolean;
}

/** Emergency stop of the motors, separate from other controls. */
export function MotorsOff({ vehicle, status, orders, watching = false }: Props) {
  const asked = vehicle.actions.includes("motors off") || status?.status.armed === true;
  const enabled = asked && !watching;
  return (
    <div className={classes["motorsOff"]}>
      <SlideToConfirm
        label="Motors off – the drone falls"
        meaning="Stops the motors at any altitude."
        disabled={!enabled}
        onConfirm={() => orders.press("motors off")}
      />
      <CommandResult orders={orders} />
    </div>
  );
}

/** Result of the last command, as an alert. */
export function CommandResult({ orders: { said } }: { orders: ReturnType<typeof useVehicleCommands> }) {
  if (said === null) return null;
  return (
    <p className={classes["said"]} data-bad={!said.accepted || undefined} role="alert">
      {said.accepted ? said.sentence : `Not sent: ${said.order}. ${said.sentence}`}
    </p>
  );
}
