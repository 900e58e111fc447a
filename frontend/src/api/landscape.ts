import { keepPreviousData, useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getLandscape } from "./generated";
import type { Theme } from "./queries";

/** The request starts the computation, so it is sent only when the panel is in view. */
export function useLandscape(campaignId: number, theme: Theme, stacked: boolean, enabled: boolean) {
  return useQuery({
    queryKey: ["campaign", campaignId, "landscape", theme, String(stacked)],
    queryFn: () => answer(getLandscape({ path: { campaign_id: campaignId }, query: { theme, stacked } })),
    placeholderData: keepPreviousData,
    enabled,
  });
}
