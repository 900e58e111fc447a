/** Everything that pages read. Keys are what `lib/events.ts` makes doubtful. */

import { keepPreviousData, useInfiniteQuery, useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import {
  type CampaignState,
  getCampaign,
  getCampaignFigure,
  getCatalogue,
  getFlightFigure,
  getProposal,
  getStatistics,
  getTrial,
  listCampaigns,
  listTrials,
  type PageTrial,
  type Sort,
  type Trial,
} from "./generated";

export type Theme = "light" | "dark";
export type FigureName = "takeoffs" | "errors" | "gains";

export interface CampaignFilter {
  search: string;
  state: CampaignState[];
  vehicle: string[];
  sort: Sort;
}

export function useCatalogue() {
  return useQuery({ queryKey: ["catalogue"], queryFn: () => answer(getCatalogue()), staleTime: Infinity });
}

const PAGE_SIZE = 24;

export function useCampaigns(filter: CampaignFilter) {
  return useInfiniteQuery({
    queryKey: ["campaigns", filter],
    queryFn: ({ pageParam }) =>
      answer(listCampaigns({ query: { ...filter, limit: PAGE_SIZE, ...(pageParam ? { cursor: pageParam } : {}) } })),
    initialPageParam: "",
    getNextPageParam: (page) => page.next_cursor,
    placeholderData: keepPreviousData,
  });
}

export function useCampaign(campaignId: number) {
  return useQuery({
    queryKey: ["campaign", campaignId],
    queryFn: () => answer(getCampaign({ path: { campaign_id: campaignId } })),
  });
}

export function useProposal(campaignId: number) {
  return useQuery({
    queryKey: ["campaign", campaignId, "proposal"],
    queryFn: () => answer(getProposal({ path: { campaign_id: campaignId } })),
  });
}

export function useStatistics(campaignId: number) {
  return useQuery({
    queryKey: ["campaign", campaignId, "statistics"],
    queryFn: () => answer(getStatistics({ path: { campaign_id: campaignId } })),
    placeholderData: keepPreviousData,
  });
}

const LARGEST_PAGE = 200;

/** Every trial of a campaign, page after page. */
async function allTrials(campaignId: number): Promise<Trial[]> {
  const trials: Trial[] = [];
  let cursor: string | null = null;
  do {
    const query: { limit: number; cursor?: string } = { limit: LARGEST_PAGE, ...(cursor === null ? {} : { cursor }) };
    const page: PageTrial = await answer(listTrials({ path: { campaign_id: campaignId }, query }));
    trials.push(...page.items);
    cursor = page.next_cursor;
  } while (cursor !== null);
  return trials;
}

export function useTrials(campaignId: number) {
  return useQuery({
    queryKey: ["campaign", campaignId, "trials"],
    queryFn: () => allTrials(campaignId),
  });
}

export function useTrial(trialId: number) {
  return useQuery({ queryKey: ["trial", trialId], queryFn: () => answer(getTrial({ path: { trial_id: trialId } })) });
}

export function useCampaignFigure(campaignId: number, name: FigureName, theme: Theme) {
  return useQuery({
    queryKey: ["campaign", campaignId, "figure", name, theme],
    queryFn: () => answer(getCampaignFigure({ path: { campaign_id: campaignId, name }, query: { theme } })),
    placeholderData: keepPreviousData,
  });
}

export function useFlightFigure(trialId: number, theme: Theme) {
  return useQuery({
    queryKey: ["trial", trialId, "figure", theme],
    queryFn: () => answer(getFlightFigure({ path: { trial_id: trialId }, query: { theme } })),
    placeholderData: keepPreviousData,
  });
}

export const recordCsv = (trialId: number): string => `/api/trials/${trialId}/trajectory.csv`;
