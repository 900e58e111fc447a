/** Access rights of this browser. */

import { useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getAccess } from "./generated";
import { readOnlyReason, type WatchedVehicle } from "./readOnly";

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
