/** What this browser may do here. */

import { useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getAccess } from "./generated";
import { readOnlyReason, type WatchedVehicle } from "./readOnly";

const LOOK_AGAIN_MS = 5000;

/** Read again until it is unlocked: the link that does it is opened in another tab. */
function useAccess() {
  return useQuery({
    queryKey: ["access"],
    queryFn: () => answer(getAccess()),
    staleTime: 0,
    refetchOnWindowFocus: "always",
    refetchInterval: ({ state }) => (state.data?.hint ? LOOK_AGAIN_MS : false),
  }).data;
}

/** Why this browser may only watch the vehicle, or anything at all (null); null where it may act. */
export function useReadOnlyReason(vehicle: WatchedVehicle | null): string | null {
  const access = useAccess();
  return access === undefined ? null : readOnlyReason(access, vehicle);
}
