/** What is said to who may only watch. */

import type { Access } from "./types";

export interface WatchedVehicle {
  name: string;
  is_real: boolean;
  registered: boolean;
}

const STOPPING = "Abort and Land work from here all the same.";

/** Why a browser may only watch: this vehicle, or whatever there is (null). Null where it may act. */
export function readOnlyReason(access: Access, vehicle: WatchedVehicle | null): string | null {
  if (vehicle === null) {
    return access.may_change ? null : sentences("This device may only watch.", access.hint);
  }
  if (!vehicle.registered || (vehicle.is_real ? access.may_command : access.may_link)) return null;
  const watching = `This browser may only watch ${vehicle.name}.`;
  if (access.elsewhere) return sentences(watching, "It is commanded on the computer that Gainline runs on.");
  if (!access.may_link) {
    return sentences(
      watching,
      "Other devices reach this server, and vehicles with a link fly only from one that is started with --host 127.0.0.1.",
    );
  }
  return sentences(watching, access.hint, STOPPING);
}

function sentences(...said: string[]): string {
  return said.filter((one) => one !== "").join(" ");
}
