/** All mutations. The event stream invalidates queries; responses are stored in the cache immediately. */

import { type MutationFunctionContext, useMutation, useQueryClient } from "@tanstack/react-query";
import { navigate } from "wouter/use-browser-location";
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
import { useVehicleChanged } from "./vehicles";

/** Store a campaign that the server answered with. */
function keepCampaign(campaign: Campaign, _sent: unknown, _before: unknown, { client }: MutationFunctionContext): void {
  client.setQueryData(["campaign", campaign.id], campaign);
  void client.invalidateQueries({ queryKey: ["campaigns"] });
}

/** Store a trial that the server answered with; everything else of its campaign follows from it. */
function keepTrial(
  trial: Trial,
  _sent: unknown,
  _before: unknown,
  { client }: MutationFunctionContext,
): Promise<unknown> {
  client.setQueryData(["trial", trial.id], trial);
  return Promise.all([
    client.invalidateQueries({ queryKey: ["campaign", trial.campaign_id] }),
    client.invalidateQueries({ queryKey: ["flying"] }),
  ]);
}

/** Has all that is shown of campaigns read again. */
function useStaleCampaigns() {
  const queries = useQueryClient();
  return () => queries.invalidateQueries({ queryKey: ["campaign"] });
}

export function useCreateCampaign() {
  return useMutation({
    mutationFn: (body: NewCampaignInput) => answer(createCampaign({ body })),
    onSuccess: keepCampaign,
  });
}

/** Plan a trial of a proposal or of manual gains, and fly it if the body requests it; otherwise open the fly screen of
 * a registered vehicle. Navigates here because the calling card is unmounted as soon as the trial is known. */
export function useCreateTrial({ id, vehicle }: Campaign) {
  return useMutation({
    mutationFn: (body: NewTrial) =>
      answer(createTrial({ path: { campaign_id: id }, body, headers: controlHeader(vehicle.id) })),
    onSuccess: (trial, sent, before, context) => {
      if (vehicle.registered && !sent.fly) navigate(`/fly/${trial.id}`);
      return keepTrial(trial, sent, before, context);
    },
    onError: useStaleCampaigns(),
  });
}

export function useFlyTrial({ vehicle }: Campaign) {
  return useMutation({
    mutationFn: ({ trialId, speed }: { trialId: number; speed: number | null }) =>
      answer(flyTrial({ path: { trial_id: trialId }, body: { speed }, headers: controlHeader(vehicle.id) })),
    onSuccess: keepTrial,
    onError: useStaleCampaigns(),
  });
}

export function useCancelTrial() {
  return useMutation({
    mutationFn: (trialId: number) => answer(cancelTrial({ path: { trial_id: trialId } })),
    onSuccess: keepTrial,
  });
}

export interface ClassificationInput {
  trial: Trial;
  outcome: "valid" | "aborted" | "invalid";
  reason: string;
}

export function useClassify() {
  return useMutation({
    mutationFn: ({ trial, outcome, reason }: ClassificationInput) =>
      answer(classifyTrial({ path: { trial_id: trial.id }, body: { version: trial.version, outcome, reason } })),
    onSuccess: keepTrial,
    onError: useStaleCampaigns(),
  });
}

export type AbortJudgementInput = "behaved badly" | "something else";

/** Why the operator aborted a flight. */
export function useJudgeAbort() {
  return useMutation({
    mutationFn: ({ trial, cause }: { trial: Trial; cause: AbortJudgementInput }) =>
      answer(judgeAbort({ path: { trial_id: trial.id }, body: { version: trial.version, cause } })),
    onSuccess: keepTrial,
    onError: useStaleCampaigns(),
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
    onSuccess: keepTrial,
    onError: useStaleCampaigns(),
  });
}

export type RecordUpload = ReturnType<typeof useUploadRecord>;

export function useRecompute(campaignId: number) {
  return useMutation({
    mutationFn: () => answer(computeProposal({ path: { campaign_id: campaignId } })),
    onSuccess: useStaleCampaigns(),
  });
}

export function useFinish(campaignId: number) {
  return useMutation({
    mutationFn: () => answer(finishCampaign({ path: { campaign_id: campaignId }, body: {} })),
    onSuccess: keepCampaign,
  });
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
  return useMutation({
    mutationFn: () => answer(rehearseCampaign({ path: { campaign_id: campaignId } })),
    onSuccess: keepCampaign,
    onSettled: useStaleCampaigns(),
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
  return useMutation({
    mutationFn: (body: Reopening) => answer(reopenCampaign({ path: { campaign_id: campaignId }, body })),
    onSettled: useStaleCampaigns(),
  });
}

export function useArchive(campaignId: number) {
  return useMutation({
    mutationFn: () => answer(archiveCampaign({ path: { campaign_id: campaignId } })),
    onSuccess: keepCampaign,
  });
}

export interface Cloning {
  /** Another vehicle; without it the same one with its settings. */
  vehicle?: NonNullable<NewCampaignInput["vehicle"]>;
  warmStart: boolean;
}

export function useClone(campaignId: number) {
  return useMutation({
    mutationFn: ({ vehicle, warmStart }: Cloning) =>
      answer(
        cloneCampaign({
          path: { campaign_id: campaignId },
          body: { warm_start: warmStart, ...(vehicle === undefined ? {} : { vehicle }) },
        }),
      ),
    onSuccess: keepCampaign,
  });
}

export function useRename(campaign: Campaign) {
  return useMutation({
    mutationFn: (name: string) =>
      answer(editCampaign({ path: { campaign_id: campaign.id }, body: { version: campaign.version, name } })),
    onSuccess: keepCampaign,
    onError: useStaleCampaigns(),
  });
}
