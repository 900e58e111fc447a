import { keepPreviousData, useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getLandscape } from "./generated";
import type { Theme } from "./queries";

/** Asking for it has the server compute it, so it is asked for once somebody looks. */
export function useLandscape(campaignId: number, theme: Theme, stacked: boolean, enabled: boolean) {
  return useQuery({
    queryKey: ["campaign", campaignId, "landscape", theme, String(stacked)],
    queryFn: () => answer(getLandscape({ path: { campaign_id: campaignId }, query: { theme, stacked } })),
    placeholderData: keepPreviousData,
    enabled,
  });
}
