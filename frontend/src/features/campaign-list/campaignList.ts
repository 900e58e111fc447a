/** Filters of the campaign list, and the progress text of a card. */

import type { CampaignState, CampaignSummary } from "../../api/types";
import { against, percentChange } from "../../ui/format";

export type StateFilter = "all" | "open" | "finished" | "archived";

export const STATE_FILTERS: { value: StateFilter; label: string }[] = [
  { value: "all", label: "All" },
  { value: "open", label: "Active" },
  { value: "finished", label: "Finished" },
  { value: "archived", label: "Archived" },
];

export const STATES: Record<StateFilter, CampaignState[]> = {
  all: ["draft", "ready", "flying", "deciding", "finished"],
  open: ["draft", "ready", "flying", "deciding"],
  finished: ["finished"],
  archived: ["archived"],
};

/** Comparison of the best gains with the first; null before the second flight. */
export function progress({ best, first_error, flights, verdict }: CampaignSummary): string | null {
  const change = percentChange(best?.mean, first_error);
  if (best === null || change === null || flights < 2) return null;
  if (verdict === null) return "no improvement yet";
  if (verdict === "unresolved") return "unresolved vs. the first gains";
  if (verdict === "not known yet") return `${against(change, "the first gains")}, verdict not known yet`;
  return against(change, "the first gains");
}
