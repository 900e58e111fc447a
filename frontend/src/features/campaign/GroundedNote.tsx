import { Anchor } from "@mantine/core";
import { Link } from "react-router";
import { useVehicle } from "../../api/vehicles";
import { Note } from "../../ui/Note";

/** Why the vehicle cannot fly now, whatever the gains; empty if it can. */
export function useGroundedReason(vehicleId: number): string {
  const vehicle = useVehicle(vehicleId);
  if (vehicle?.state === "quarantined") return `${vehicle.name} is quarantined.`;
  return vehicle?.registered && vehicle.state === "disconnected" ? `${vehicle.name} is not connected.` : "";
}

/** The reason, with a link to the vehicle; renders nothing without one. */
export function GroundedNote({ vehicleId }: { vehicleId: number }) {
  const why = useGroundedReason(vehicleId);
  if (why === "") return null;
  return (
    <Note fz="body">
      {why}{" "}
      <Anchor component={Link} to={`/vehicles/${vehicleId}`}>
        Open vehicle
      </Anchor>
    </Note>
  );
}
