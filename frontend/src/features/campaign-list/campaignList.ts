/** Filters of the campaign list, and the progress text of a card. */

import type { CampaignState, CampaignSummary } from "../../api/types";
import { against, percentChange } from "../../ui/format";

const ACTIVE: CampaignState[] = ["draft", "ready", "flying", "deciding"];

/** The states of campaigns that a filter shows. */
export const STATES = {
  All: [...ACTIVE, "finished"],
  Active: ACTIVE,
  Finished: ["finished"],
  Archived: ["archived"],
} satisfies Record<string, CampaignState[]>;

export type StateFilter = keyof typeof STATES;

/** Comparison of the best gains with the first; null before the second flight. */
export function progress({ best, first_error, flights, verdict }: CampaignSummary): string | null {
  const change = percentChange(best?.mean, first_error);
  if (best === null || change === null || flights < 2) return null;
  if (verdict === null) return "no improvement yet";
  if (verdict === "unresolved") return "unresolved vs. the first gains";
  if (verdict === "not known yet") return `${against(change, "the first gains")}, verdict not known yet`;
  return against(change, "the first gains");
}
