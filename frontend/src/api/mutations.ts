/** All mutations. The event stream invalidates queries; responses are stored in the cache immediately. */

import { type UseMutationOptions, useMutation, useQueryClient } from "@tanstack/react-query";
import { navigate } from "wouter/use-browser-location";
import { answer } from "./client";
import {
  type AbortJudgement,
  archiveCampaign,
  type Campaign,
  type Classification,
  type Clone,
  cancelTrial,
  classifyTrial,
  cloneCampaign,
  computeProposal,
  createCampaign,
  createTrial,
  deleteCampaign,
  editCampaign,
  finishCampaign,
  flyTrial,
  importFlight,
  judgeAbort,
  type NewCampaignInput,
  type NewTrial,
  promoteBest,
  type Reading,
  type Reopening,
  rehearseCampaign,
  reopenCampaign,
  type Trial,
  uploadTrajectory,
} from "./generated";
import { controlHeader } from "./leases";
import type { RecordFiles } from "./records";
import { useVehicleChanged } from "./vehicles";

/** Has all that is shown of a campaign read again. */
function useStaleCampaign(campaignId: number) {
  const queries = useQueryClient();
  return () => queries.invalidateQueries({ queryKey: ["campaign", campaignId] });
}

type After<Answer, Sent> = Pick<UseMutationOptions<Answer, Error, Sent>, "onError" | "onSettled">;

/** A request that is answered with a campaign, which is stored. */
function useCampaignRequest<Sent>(send: (sent: Sent) => Promise<Campaign>, after: After<Campaign, Sent> = {}) {
  return useMutation({
    mutationFn: send,
    onSuccess: (campaign, _sent, _before, { client }) => {
      client.setQueryData(["campaign", campaign.id], campaign);
      void client.invalidateQueries({ queryKey: ["campaigns"] });
    },
    ...after,
  });
}

/** A request that is answered with a trial, which is stored; everything else of its campaign follows from it. */
function useTrialRequest<Sent>(
  send: (sent: Sent) => Promise<Trial>,
  after: After<Trial, Sent> = {},
  onStored?: (trial: Trial, sent: Sent) => void,
) {
  return useMutation({
    mutationFn: send,
    onSuccess: (trial, sent, _before, { client }) => {
      onStored?.(trial, sent);
      client.setQueryData(["trial", trial.id], trial);
      return Promise.all([
        client.invalidateQueries({ queryKey: ["campaign", trial.campaign_id] }),
        client.invalidateQueries({ queryKey: ["flying"] }),
      ]);
    },
    ...after,
  });
}

export function useCreateCampaign() {
  return useCampaignRequest((body: NewCampaignInput) => answer(createCampaign({ body })));
}

/** Plan a trial of a proposal or of manual gains, and fly it if the body requests it; otherwise open the fly screen of
 * a registered vehicle. Navigates here because the calling card is unmounted as soon as the trial is known. */
export function useCreateTrial({ id, vehicle }: Campaign) {
  return useTrialRequest(
    (body: NewTrial) => answer(createTrial({ path: { campaign_id: id }, body, headers: controlHeader(vehicle.id) })),
    { onError: useStaleCampaign(id) },
    (trial, { fly }) => vehicle.registered && !fly && navigate(`/fly/${trial.id}`),
  );
}

export function useFlyTrial({ id, vehicle }: Campaign) {
  return useTrialRequest(
    ({ trialId, speed }: { trialId: number; speed: number | null }) =>
      answer(flyTrial({ path: { trial_id: trialId }, body: { speed }, headers: controlHeader(vehicle.id) })),
    { onError: useStaleCampaign(id) },
  );
}

export function useCancelTrial() {
  return useTrialRequest((trialId: number) => answer(cancelTrial({ path: { trial_id: trialId } })));
}

export function useClassify({ id, version, campaign_id }: Trial) {
  return useTrialRequest(
    (review: Omit<Classification, "version">) =>
      answer(classifyTrial({ path: { trial_id: id }, body: { version, ...review } })),
    { onError: useStaleCampaign(campaign_id) },
  );
}

/** Why the operator aborted a flight. */
export function useJudgeAbort({ id, version, campaign_id }: Trial) {
  return useTrialRequest(
    (cause: AbortJudgement["cause"]) => answer(judgeAbort({ path: { trial_id: id }, body: { version, cause } })),
    { onError: useStaleCampaign(campaign_id) },
  );
}

export interface RecordOrder extends RecordFiles {
  trialId?: number;
  plan?: NewTrial;
  /** Number of the takeoff in a log with several. */
  takeoff?: number;
  /** Accept the log's gains although they differ from the planned ones. */
  confirm?: boolean;
  /** Store a record that cannot be scored or is implausible, as an invalid flight. */
  invalid?: boolean;
  /** Read the record in these units, with this sign, above this datum. */
  reads_as?: Reading[];
}

/** Upload the record of a flight made elsewhere: of a planned trial, or with the trial to plan. */
export function useUploadRecord(campaignId: number) {
  return useTrialRequest(
    ({ file, companion, trialId, plan = {}, ...query }: RecordOrder) =>
      answer(
        trialId === undefined
          ? importFlight({
              path: { campaign_id: campaignId },
              query,
              body: { file, companion, trial: JSON.stringify(plan) },
            })
          : uploadTrajectory({ path: { trial_id: trialId }, query, body: { file, companion } }),
      ),
    { onError: useStaleCampaign(campaignId) },
  );
}

export type RecordUpload = ReturnType<typeof useUploadRecord>;

export function useRecompute(campaignId: number) {
  return useMutation({
    mutationFn: () => answer(computeProposal({ path: { campaign_id: campaignId } })),
    onSuccess: useStaleCampaign(campaignId),
  });
}

export function useFinish(campaignId: number) {
  return useCampaignRequest(() => answer(finishCampaign({ path: { campaign_id: campaignId }, body: {} })));
}

/** Delete a campaign that has not flown. */
export function useDeleteCampaign({ id, version }: Campaign, onDeleted: () => void) {
  return useMutation({
    mutationFn: () => answer(deleteCampaign({ path: { campaign_id: id }, query: { version } })),
    onSuccess: (_none, _sent, _before, { client }) => {
      onDeleted();
      void client.invalidateQueries({ queryKey: ["campaigns"] });
    },
  });
}

/** Create the campaign that rehearses this one on a simulation. */
export function useRehearse(campaignId: number) {
  return useCampaignRequest(() => answer(rehearseCampaign({ path: { campaign_id: campaignId } })), {
    onSettled: useStaleCampaign(campaignId),
  });
}

/** Set the best gains as the safe gains of the campaign's registered vehicle. */
export function usePromote({ id, vehicle }: Campaign) {
  const changed = useVehicleChanged();
  return useMutation({
    mutationFn: (body: { version: number; statement: string }) =>
      answer(promoteBest({ path: { campaign_id: id }, body, headers: controlHeader(vehicle.id) })),
    onSettled: () => changed(vehicle.id),
  });
}

/** Continue a finished campaign for some flights, of which `plan` lists those that are planned at once, in order. */
export function useReopen(campaignId: number) {
  return useCampaignRequest((body: Reopening) => answer(reopenCampaign({ path: { campaign_id: campaignId }, body })), {
    onSettled: useStaleCampaign(campaignId),
  });
}

export function useArchive(campaignId: number) {
  return useCampaignRequest(() => answer(archiveCampaign({ path: { campaign_id: campaignId } })));
}

/** Without a vehicle, the same one with its settings. */
export function useClone(campaignId: number) {
  return useCampaignRequest((body: Clone) => answer(cloneCampaign({ path: { campaign_id: campaignId }, body })));
}

export function useRename(campaign: Campaign) {
  return useCampaignRequest(
    (name: string) =>
      answer(editCampaign({ path: { campaign_id: campaign.id }, body: { version: campaign.version, name } })),
    { onError: useStaleCampaign(campaign.id) },
  );
}
