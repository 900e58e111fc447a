/** All queries. `live/staleQueries.ts` invalidates them by their keys. */

import { useComputedColorScheme } from "@mantine/core";
import { keepPreviousData, type QueryKey, skipToken, useQuery, useQueryClient } from "@tanstack/react-query";
import { useCallback } from "react";
import { answer } from "./client";
import {
  type CampaignState,
  getCampaign,
  getCampaignFigure,
  getCatalogue,
  getFlightFigure,
  getLandscape,
  getProposal,
  getStatistics,
  getTrajectory,
  getTrial,
  listCampaigns,
  listTrials,
  type Sort,
  type Trial,
} from "./generated";
import { everyPage, usePages } from "./pages";

export type Theme = "light" | "dark";
export type FigureName = "takeoffs" | "errors" | "gains";

/** Start and end, in seconds of the flight. */
export type TimeRange = readonly [number, number];

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
  return usePages(["campaigns", filter], PAGE_SIZE, (page) => answer(listCampaigns({ query: { ...filter, ...page } })));
}

export function useCampaign(campaignId: number | null) {
  return useQuery({
    queryKey: ["campaign", campaignId],
    queryFn: campaignId === null ? skipToken : () => answer(getCampaign({ path: { campaign_id: campaignId } })),
  });
}

const COMPUTING_POLL_MS = 2000;

/** The next gains. While they are computed they are also asked for, in case their event is lost. */
export function useProposal(campaignId: number) {
  return useQuery({
    queryKey: ["campaign", campaignId, "proposal"],
    queryFn: () => answer(getProposal({ path: { campaign_id: campaignId } })),
    refetchInterval: ({ state }) => (state.data?.state === "computing" ? COMPUTING_POLL_MS : false),
  });
}

export function useStatistics(campaignId: number) {
  return useQuery({
    queryKey: ["campaign", campaignId, "statistics"],
    queryFn: () => answer(getStatistics({ path: { campaign_id: campaignId } })),
    placeholderData: keepPreviousData,
  });
}

export function useTrials(campaignId: number) {
  return useQuery({
    queryKey: ["campaign", campaignId, "trials"],
    queryFn: () => everyPage((query) => answer(listTrials({ path: { campaign_id: campaignId }, query }))),
  });
}

export function useTrial(trialId: number | null) {
  return useQuery({
    queryKey: ["trial", trialId],
    queryFn: trialId === null ? skipToken : () => answer(getTrial({ path: { trial_id: trialId } })),
  });
}

interface FigureOptions {
  enabled?: boolean;
  staleTime?: number;
}

/** A figure in the page's colours; the one before is shown until it is there. */
export function useFigure<Figure>(key: QueryKey, read: (theme: Theme) => Promise<Figure>, options?: FigureOptions) {
  const theme = useComputedColorScheme("light");
  return useQuery({
    queryKey: [...key, theme],
    queryFn: () => read(theme),
    placeholderData: keepPreviousData,
    ...options,
  });
}

/** Detail of a figure: a time window at full resolution, one flight drawn individually, and the flight whose prediction
 * is drawn instead of the next one's. */
export interface FigureView {
  window?: TimeRange | null;
  flight?: number | null;
  predicted?: number;
}

export function useCampaignFigure(
  campaignId: number,
  name: FigureName,
  { window, flight, predicted }: FigureView = {},
) {
  const detail = { predicted, flight: flight ?? undefined, from_s: window?.[0], to_s: window?.[1] };
  return useFigure(["campaign", campaignId, "figure", name, detail], (theme) =>
    answer(getCampaignFigure({ path: { campaign_id: campaignId, name }, query: { ...detail, theme } })),
  );
}

const POINTS = 300;

/** The scored output of a flight, downsampled; null without a record. */
export function useCurveOf(trials: readonly Trial[], experiment: string) {
  const client = useQueryClient();
  const output = useCatalogue().data?.experiments.find(({ name }) => name === experiment)?.output ?? "";
  return useCallback(
    async (flight: number) => {
      const trial = trials.find(({ number, record }) => number === flight && record !== null);
      if (trial === undefined) return null;
      const record = await client.fetchQuery({
        queryKey: ["trial", trial.id, "record", POINTS],
        queryFn: () => answer(getTrajectory({ path: { trial_id: trial.id }, query: { points: POINTS } })),
        staleTime: Infinity,
      });
      return { x: record.time_s, y: record.channels[output] ?? [] };
    },
    [client, trials, output],
  );
}

export function useFlightFigure(trialId: number) {
  return useFigure(["trial", trialId, "figure"], (theme) =>
    answer(getFlightFigure({ path: { trial_id: trialId }, query: { theme } })),
  );
}

export const recordCsv = (trialId: number): string => `/api/trials/${trialId}/trajectory.csv`;

/** The request starts the computation, so it is sent only when the panel is in view. */
export function useLandscape(campaignId: number, enabled: boolean) {
  return useFigure(
    ["campaign", campaignId, "landscape"],
    (theme) => answer(getLandscape({ path: { campaign_id: campaignId }, query: { theme } })),
    { enabled },
  );
}
