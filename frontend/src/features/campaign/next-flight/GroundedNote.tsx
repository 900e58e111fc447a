import { Anchor } from "@mantine/core";
import { Link } from "react-router";
import { useVehicle } from "../../../api/vehicles";
import { Note } from "../../../ui/Note";
import { groundedReason } from "../../fleet/fleet";

/** Why the vehicle cannot fly now, whatever the gains; empty if it can. */
export function useGroundedReason(vehicleId: number): string {
  const vehicle = useVehicle(vehicleId);
  return vehicle === null ? "" : groundedReason(vehicle);
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
