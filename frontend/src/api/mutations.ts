/** All mutations. The event stream invalidates queries; responses are stored in the cache immediately. */

import { useMutation, useQueryClient } from "@tanstack/react-query";
import { useNavigate } from "react-router";
import { answer } from "./client";
import {
  archiveCampaign,
  type Campaign,
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
  type Reopening,
  rehearseCampaign,
  reopenCampaign,
  type Trial,
  uploadTrajectory,
} from "./generated";
import { controlHeader } from "./leases";
import type { RecordFiles } from "./records";

function useSettled() {
  const queries = useQueryClient();
  return {
    campaign: (campaign: Campaign): void => {
      queries.setQueryData(["campaign", campaign.id], campaign);
      void queries.invalidateQueries({ queryKey: ["campaigns"] });
    },
    ofCampaign: (campaignId: number): Promise<void> =>
      queries.invalidateQueries({ queryKey: ["campaign", campaignId] }),
    trial: (trial: Trial): Promise<unknown> => {
      queries.setQueryData(["trial", trial.id], trial);
      return Promise.all([
        queries.invalidateQueries({ queryKey: ["campaign", trial.campaign_id] }),
        queries.invalidateQueries({ queryKey: ["flying"] }),
      ]);
    },
  };
}

export function useCreateCampaign() {
  const settled = useSettled();
  return useMutation({
    mutationFn: (body: NewCampaignInput) => answer(createCampaign({ body })),
    onSuccess: settled.campaign,
  });
}

/** Plan a trial of a proposal or of manual gains, and fly it if the body requests it; otherwise open the fly screen of
 * a registered vehicle. Navigates here because the calling card is unmounted as soon as the trial is known. */
export function useCreateTrial({ id, vehicle }: Campaign) {
  const settled = useSettled();
  const navigate = useNavigate();
  return useMutation({
    mutationFn: (body: NewTrial) =>
      answer(createTrial({ path: { campaign_id: id }, body, headers: controlHeader(vehicle.id) })),
    onSuccess: (trial, { fly }) => {
      if (vehicle.registered && !fly) void navigate(`/fly/${trial.id}`);
      return settled.trial(trial);
    },
    onError: () => settled.ofCampaign(id),
  });
}

export function useFlyTrial({ id, vehicle }: Campaign) {
  const settled = useSettled();
  return useMutation({
    mutationFn: ({ trialId, speed }: { trialId: number; speed: number | null }) =>
      answer(flyTrial({ path: { trial_id: trialId }, body: { speed }, headers: controlHeader(vehicle.id) })),
    onSuccess: settled.trial,
    onError: () => settled.ofCampaign(id),
  });
}

export function useCancelTrial() {
  const settled = useSettled();
  return useMutation({
    mutationFn: (trialId: number) => answer(cancelTrial({ path: { trial_id: trialId } })),
    onSuccess: settled.trial,
  });
}

export interface ClassificationInput {
  trial: Trial;
  outcome: "valid" | "aborted" | "invalid";
  reason: string;
}

export function useClassify() {
  const settled = useSettled();
  return useMutation({
    mutationFn: ({ trial, outcome, reason }: ClassificationInput) =>
      answer(classifyTrial({ path: { trial_id: trial.id }, body: { version: trial.version, outcome, reason } })),
    onSuccess: settled.trial,
    onError: (_error, { trial }) => settled.ofCampaign(trial.campaign_id),
  });
}

export type AbortJudgementInput = "behaved badly" | "something else";

/** Why the operator aborted a flight. */
export function useJudgeAbort() {
  const settled = useSettled();
  return useMutation({
    mutationFn: ({ trial, cause }: { trial: Trial; cause: AbortJudgementInput }) =>
      answer(judgeAbort({ path: { trial_id: trial.id }, body: { version: trial.version, cause } })),
    onSuccess: settled.trial,
    onError: (_error, { trial }) => settled.ofCampaign(trial.campaign_id),
  });
}

export interface RecordOrder extends RecordFiles {
  trialId?: number;
  plan?: NewTrial;
  /** Number of the takeoff in a log with several. */
  takeoff?: number;
  /** Accept the log's gains although they differ from the planned ones. */
  confirm?: boolean;
  /** Store a record that cannot be scored, as an invalid flight. */
  invalid?: boolean;
}

/** Upload the record of a flight made elsewhere: of a planned trial, or with the trial to plan. */
export function useUploadRecord(campaignId: number) {
  const settled = useSettled();
  return useMutation({
    mutationFn: ({ file, companion, trialId, plan, ...query }: RecordOrder) => {
      const files = { file, ...(companion === undefined ? {} : { companion }) };
      return answer(
        trialId === undefined
          ? importFlight({
              path: { campaign_id: campaignId },
              query,
              body: { ...files, trial: JSON.stringify(plan ?? {}) },
            })
          : uploadTrajectory({ path: { trial_id: trialId }, query, body: files }),
      );
    },
    onSuccess: settled.trial,
    onError: () => settled.ofCampaign(campaignId),
  });
}

export type RecordUpload = ReturnType<typeof useUploadRecord>;

export function useRecompute(campaignId: number) {
  const settled = useSettled();
  return useMutation({
    mutationFn: () => answer(computeProposal({ path: { campaign_id: campaignId } })),
    onSuccess: () => settled.ofCampaign(campaignId),
  });
}

export function useFinish(campaignId: number) {
  const settled = useSettled();
  return useMutation({
    mutationFn: () => answer(finishCampaign({ path: { campaign_id: campaignId }, body: {} })),
    onSuccess: settled.campaign,
  });
}

/** Delete a campaign that has not flown. */
export function useDeleteCampaign({ id, version }: Campaign, onDeleted: () => void) {
  const queries = useQueryClient();
  return useMutation({
    mutationFn: () => answer(deleteCampaign({ path: { campaign_id: id }, query: { version } })),
    onSuccess: () => {
      onDeleted();
      void queries.invalidateQueries({ queryKey: ["campaigns"] });
    },
  });
}

/** Create the campaign that rehearses this one on a simulation. */
export function useRehearse(campaignId: number) {
  const settled = useSettled();
  return useMutation({
    mutationFn: () => answer(rehearseCampaign({ path: { campaign_id: campaignId } })),
    onSuccess: settled.campaign,
    onSettled: () => settled.ofCampaign(campaignId),
  });
}

/** Set the best gains as the safe gains of the campaign's registered vehicle. */
export function usePromote({ id, vehicle }: Campaign) {
  const queries = useQueryClient();
  return useMutation({
    mutationFn: (body: { version: number; statement: string }) =>
      answer(promoteBest({ path: { campaign_id: id }, body, headers: controlHeader(vehicle.id) })),
    onSettled: () =>
      Promise.all([
        queries.invalidateQueries({ queryKey: ["vehicles"] }),
        queries.invalidateQueries({ queryKey: ["vehicle", vehicle.id] }),
      ]),
  });
}

/** Continue a finished campaign for some flights, of which `plan` lists those that are planned at once, in order. */
export function useReopen(campaignId: number) {
  const settled = useSettled();
  return useMutation({
    mutationFn: (body: Reopening) => answer(reopenCampaign({ path: { campaign_id: campaignId }, body })),
    onSettled: () => settled.ofCampaign(campaignId),
  });
}

export function useArchive(campaignId: number) {
  const settled = useSettled();
  return useMutation({
    mutationFn: () => answer(archiveCampaign({ path: { campaign_id: campaignId } })),
    onSuccess: settled.campaign,
  });
}

export interface Cloning {
  /** Another vehicle; without it the same one with its settings. */
  vehicle?: NonNullable<NewCampaignInput["vehicle"]>;
  warmStart: boolean;
}

export function useClone(campaignId: number) {
  const settled = useSettled();
  return useMutation({
    mutationFn: ({ vehicle, warmStart }: Cloning) =>
      answer(
        cloneCampaign({
          path: { campaign_id: campaignId },
          body: { warm_start: warmStart, ...(vehicle === undefined ? {} : { vehicle }) },
        }),
      ),
    onSuccess: settled.campaign,
  });
}

export function useRename(campaign: Campaign) {
  const settled = useSettled();
  return useMutation({
    mutationFn: (name: string) =>
      answer(editCampaign({ path: { campaign_id: campaign.id }, body: { version: campaign.version, name } })),
    onSuccess: settled.campaign,
    onError: () => settled.ofCampaign(campaign.id),
  });
}
