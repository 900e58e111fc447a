import { useState } from "react";
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
  const campaign = useCampaign(campaignId);
  const trials = useTrials(campaignId);
  const next = useProposal(campaignId);
  const [held, setHeld] = useState<CampaignStatus | null>(null);
  const parts = { campaign: campaign.data, trials: trials.data, next: next.data };
  const areNew = [campaign, trials, next].every(({ isStale, error }) => !isStale || error !== null);
  const areOther = parts.campaign !== held?.campaign || parts.trials !== held?.trials || parts.next !== held?.next;
  if (areNew && areOther && isKnown(parts)) setHeld(parts);
  // A landing is shown at once: a landed flight must not be shown as flying.
  if (held !== null && parts.trials !== undefined && hasLanded(held.campaign, parts.trials)) {
    return { ...held, trials: parts.trials };
  }
  return held;
}

function isKnown(parts: { [Part in keyof CampaignStatus]: CampaignStatus[Part] | undefined }): parts is CampaignStatus {
  return parts.campaign !== undefined && parts.trials !== undefined && parts.next !== undefined;
}
