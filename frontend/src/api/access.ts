/** What this browser may do here. */

import { useQuery } from "@tanstack/react-query";
import { type WatchedVehicle, watchOnly } from "../lib/access";
import { answer } from "./client";
import { getAccess } from "./generated";

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
export function useWatchOnly(vehicle: WatchedVehicle | null): string | null {
  const access = useAccess();
  return access === undefined ? null : watchOnly(access, vehicle);
}
