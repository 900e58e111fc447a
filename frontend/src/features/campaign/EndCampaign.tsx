/** Acts that end a campaign, each after a question. */

import { navigate } from "wouter/use-browser-location";
import { useArchive, useDeleteCampaign, useFinish } from "../../api/mutations";
import type { Campaign } from "../../api/types";
import { Question } from "../../ui/Question";

/** Ends the campaign between flights; planned trials are cancelled. */
export function StopCampaign({ campaignId }: { campaignId: number }) {
  return (
    <Question
      act="Stop campaign"
      question="Stop this campaign? Its flights are kept, and it can be reopened."
      otherwise="Continue campaign"
      mutation={useFinish(campaignId)}
    />
  );
}

/** Moves a finished campaign to the archive. */
export function ArchiveCampaign({ campaignId }: { campaignId: number }) {
  return (
    <Question
      act="Archive"
      question="Archive this campaign? It stays readable and can be cloned, but not reopened or reviewed any more."
      otherwise="Cancel"
      mutation={useArchive(campaignId)}
    />
  );
}

/** Deletes a campaign that has not flown. */
export function DeleteCampaign({ campaign }: { campaign: Campaign }) {
  return (
    <Question
      act="Delete campaign"
      question="Delete this campaign? It has not flown, and nothing of it is kept."
      otherwise="Cancel"
      mutation={useDeleteCampaign(campaign, () => navigate("/"))}
    />
  );
}
