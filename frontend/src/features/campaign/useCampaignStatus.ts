import { useMemo, useState } from "react";
import { useCampaign, useProposal, useTrials } from "../../api/queries";
import type { Campaign, NextFlight, Trial } from "../../api/types";
import { hasLanded } from "./next-flight/nextStep";

/** A consistent set of a campaign, its trials and its next flight. */
export interface CampaignStatus {
  campaign: Campaign;
  trials: readonly Trial[];
  next: NextFlight;
}

/** Null until all parts are loaded. Keeps the last consistent set while a part is stale, so that the page does not ask
 * for a review that was just given or offer superseded gains. */
export function useCampaignStatus(campaignId: number): CampaignStatus | null {
  const parts = [useCampaign(campaignId), useTrials(campaignId), useProposal(campaignId)] as const;
  const [campaign, trials, next] = [parts[0].data, parts[1].data, parts[2].data];
  const read = useMemo(() => campaign && trials && next && { campaign, trials, next }, [campaign, trials, next]);
  const [held, setHeld] = useState<CampaignStatus | null>(null);
  if (read && read !== held && parts.every(({ isStale, error }) => !isStale || error !== null)) setHeld(read);
  // A landing is shown at once: a landed flight must not be shown as flying.
  return held !== null && trials !== undefined && hasLanded(held.campaign, trials) ? { ...held, trials } : held;
}
