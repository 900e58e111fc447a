/** A campaign's parts as its page shows them: read apart, shown together. */

import { useState } from "react";
import { useCampaign, useProposal, useTrials } from "../../api/queries";
import type { Campaign, NextFlight, Trial } from "../../api/types";
import { hasLanded } from "./nextStep";

/** A campaign with its flights and its next one, as they belong together. */
export interface CampaignStatus {
  campaign: Campaign;
  trials: readonly Trial[];
  next: NextFlight;
}

/** Null until all of it is known. Each part is read by itself: what a change has made doubtful is not put beside what is
 * new already, so that nobody is asked for what was said a moment ago, or offered gains that are overtaken. */
export function useCampaignStatus(campaignId: number): CampaignStatus | null {
  const campaign = useCampaign(campaignId);
  const trials = useTrials(campaignId);
  const next = useProposal(campaignId);
  const [held, setHeld] = useState<CampaignStatus | null>(null);
  const parts = { campaign: campaign.data, trials: trials.data, next: next.data };
  const areNew = [campaign, trials, next].every(({ isStale, error }) => !isStale || error !== null);
  const areOther = parts.campaign !== held?.campaign || parts.trials !== held?.trials || parts.next !== held?.next;
  if (areNew && areOther && isKnown(parts)) setHeld(parts);
  // A landing is told at once: nothing is shown in the air that is known to be down.
  if (held !== null && parts.trials !== undefined && hasLanded(held.campaign, parts.trials)) {
    return { ...held, trials: parts.trials };
  }
  return held;
}

function isKnown(parts: { [Part in keyof CampaignStatus]: CampaignStatus[Part] | undefined }): parts is CampaignStatus {
  return parts.campaign !== undefined && parts.trials !== undefined && parts.next !== undefined;
}
