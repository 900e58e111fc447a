/** The list of campaigns: its filters, and what a card says about progress. */

import type { CampaignState, CampaignSummary } from "../api/types";
import { against, percentChange } from "./format";

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

/** The best flight against the first, in words; null before there are two. */
export function progress({ best, first_error, flights }: CampaignSummary): string | null {
  const change = percentChange(best?.error, first_error);
  if (best === null || change === null || flights < 2) return null;
  return change === 0 ? "none better yet" : against(change, "the first");
}
