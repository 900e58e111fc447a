/** Whether the best gains may become the vehicle's safe gains, and what the vehicle holds after that. */

import type { Campaign, Vehicle } from "../../../api/types";
import { gainsInBrackets, inOrder, safeGainsWritten, sameHeld } from "../../../ui/gains";

/** Why the best gains may not become the vehicle's safe gains, and what to do; empty if they may. */
export function promotionRefusal(
  { gains, verdict }: NonNullable<Campaign["winner"]>,
  { name, safe_gains: safe }: Pick<Vehicle, "name" | "safe_gains">,
): string {
  if (sameHeld(safe, gains)) return `The best gains are the safe gains of ${name}.`;
  if (verdict === "better") return "";
  if (verdict === null) {
    return "The best gains so far are the first flight's. Only gains that are shown to be better than these can become the safe gains: fly others first.";
  }
  return `The best gains cannot become the safe gains of ${name}: their verdict is “${verdict}”. Fly the best and the first gains again until the verdict is “better”.`;
}

/** After a change of the safe gains: the gains on the vehicle until the new ones are written; empty if they are written
 * or the vehicle's gains are unknown. */
export function heldGainsNotice({
  name,
  state,
  identity,
  held,
  safe_gains: safe,
}: Pick<Vehicle, "name" | "state" | "identity" | "held" | "safe_gains">): string {
  if (held === null || Object.keys(held).length === 0 || sameHeld(held, safe)) return "";
  const gains = gainsInBrackets(inOrder(held, Object.keys(safe)));
  const reading = state === "disconnected" ? `held ${gains} when last read` : `still holds ${gains}`;
  return `${name} ${reading}. ${safeGainsWritten({ state, identity })}`;
}
