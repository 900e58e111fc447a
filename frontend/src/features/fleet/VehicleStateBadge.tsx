import type { Vehicle } from "../../api/types";
import { useVehicleStatus } from "../../live/store";
import { StateBadge } from "../../ui/Badges";
import { vehicleStateLabel } from "./fleet";

/** State of a vehicle, as far as it is known now. */
export function VehicleStateBadge({ vehicle }: { vehicle: Vehicle }) {
  const status = useVehicleStatus(vehicle.registered ? vehicle.id : null);
  return <StateBadge words={vehicleStateLabel(vehicle, status)} />;
}
