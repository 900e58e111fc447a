/** The list of campaigns: its filters, and what a card says about progress. */

import type { CampaignState, CampaignSummary } from "../../api/types";
import { against, percentChange } from "../../ui/format";

export type StateFilter = "all" | "open" | "finished" | "archived";

export const STATE_FILTERS: { value: StateFilter; label: string }[] = [
  { value: "all", label: "All" },
  { value: "open", label: "Under way" },
  { value: "finished", label: "Finished" },
  { value: "archived", label: "Archived" },
];

const STATES: Record<StateFilter, CampaignState[]> = {
  all: ["draft", "ready", "flying", "deciding", "finished"],
  open: ["draft", "ready", "flying", "deciding"],
  finished: ["finished"],
  archived: ["archived"],
};

export function statesFor(filter: StateFilter): CampaignState[] {
  return STATES[filter];
}

/** The best gains against the first flight's, in words; null before there are two flights. */
export function progress({ best, first_error, flights, verdict }: CampaignSummary): string | null {
  const change = percentChange(best?.mean, first_error);
  if (best === null || change === null || flights < 2) return null;
  if (verdict === null) return "none better yet";
  if (verdict === "unresolved") return "not told apart from the first";
  if (verdict === "not known yet") return `${against(change, "the first")}, not known yet whether by chance`;
  return against(change, "the first");
}
