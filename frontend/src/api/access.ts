/** Access rights of this browser. */

import { useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getAccess } from "./generated";
import type { Access } from "./types";

const LOOK_AGAIN_MS = 5000;

/** What is said of the access, null before it is known. Polled until unlocked, because the unlock link is opened in
 * another tab. */
function useAccess(say: (access: Access) => string | null): string | null {
  const { data = null } = useQuery({
    queryKey: ["access"],
    queryFn: () => answer(getAccess()),
    staleTime: 0,
    refetchOnWindowFocus: "always",
    refetchInterval: ({ state }) => (state.data?.hint ? LOOK_AGAIN_MS : false),
    select: say,
  });
  return data;
}

/** Why this browser has read-only access to the vehicle, or to the server if null; null if it may act. */
export function useReadOnlyReason(vehicle: WatchedVehicle | null): string | null {
  return useAccess((access) => readOnlyReason(access, vehicle));
}

/** What the unlock link that was opened permits; null before the answer. */
export function useUnlocked(): string | null {
  return useAccess(({ may_change, may_command }) => {
    if (may_command) return "This browser may now command real vehicles.";
    return may_change ? "This browser may now change campaigns and fly simulated vehicles." : null;
  });
}

/** Why this browser may not register such a vehicle; null if it may. */
export function useRegistrationRefusal(isReal: boolean): string | null {
  return useAccess((access) => registrationRefusal(access, isReal));
}

export function registrationRefusal(access: Access, isReal: boolean): string | null {
  const wayOn = access.may_change ? wayToCommand(access, isReal) : null;
  return wayOn && sentences(`This browser may not register a ${isReal ? "real" : "simulated"} vehicle.`, wayOn);
}

export interface WatchedVehicle {
  name: string;
  is_real: boolean;
  registered: boolean;
}

/** Why a browser has read-only access to the vehicle, or to the server if null. Null if it may act. */
export function readOnlyReason(access: Access, vehicle: WatchedVehicle | null): string | null {
  if (vehicle === null) {
    return access.may_change ? null : sentences("This browser has read-only access.", access.hint);
  }
  const wayOn = vehicle.registered ? wayToCommand(access, vehicle.is_real) : null;
  if (wayOn === null) return null;
  const isStopPossible = !access.elsewhere && access.may_link;
  return sentences(
    `This browser has read-only access to ${vehicle.name}.`,
    wayOn,
    isStopPossible ? "Abort and Land still work from here." : "",
  );
}

/** How such a vehicle can be commanded; null if this browser may. */
function wayToCommand(access: Access, isReal: boolean): string | null {
  if (isReal ? access.may_command : access.may_link) return null;
  if (access.elsewhere) return "Operate it from the computer that runs Gainline.";
  return access.may_link
    ? access.hint
    : "Other devices can reach this server. To fly this vehicle, restart Gainline with --host 127.0.0.1.";
}

function sentences(...parts: string[]): string {
  return parts.filter((one) => one !== "").join(" ");
}
