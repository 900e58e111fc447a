/** Access rights of this browser. */

import { useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getAccess } from "./generated";
import type { Access } from "./types";

const LOOK_AGAIN_MS = 5000;

/** Polled until unlocked, because the unlock link is opened in another tab. */
function useAccess() {
  return useQuery({
    queryKey: ["access"],
    queryFn: () => answer(getAccess()),
    staleTime: 0,
    refetchOnWindowFocus: "always",
    refetchInterval: ({ state }) => (state.data?.hint ? LOOK_AGAIN_MS : false),
  }).data;
}

/** Why this browser has read-only access to the vehicle, or to the server if null; null if it may act. */
export function useReadOnlyReason(vehicle: WatchedVehicle | null): string | null {
  const access = useAccess();
  return access === undefined ? null : readOnlyReason(access, vehicle);
}

export interface WatchedVehicle {
  name: string;
  is_real: boolean;
  registered: boolean;
}

const STOPPING = "Abort and Land still work from here.";

/** Why a browser has read-only access to the vehicle, or to the server if null. Null if it may act. */
export function readOnlyReason(access: Access, vehicle: WatchedVehicle | null): string | null {
  if (vehicle === null) {
    return access.may_change ? null : sentences("This device has read-only access.", access.hint);
  }
  if (!vehicle.registered || (vehicle.is_real ? access.may_command : access.may_link)) return null;
  const watching = `This browser has read-only access to ${vehicle.name}.`;
  if (access.elsewhere) return sentences(watching, "Operate it on the computer that runs Gainline.");
  if (!access.may_link) {
    return sentences(
      watching,
      "Other devices can reach this server. To fly this vehicle, restart Gainline with --host 127.0.0.1.",
    );
  }
  return sentences(watching, access.hint, STOPPING);
}

function sentences(...parts: string[]): string {
  return parts.filter((one) => one !== "").join(" ");
}
