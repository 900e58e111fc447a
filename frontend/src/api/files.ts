/** Campaigns as files: a report printed by the server, and bundles that come in from another installation. */

import { useMutation, useQueryClient } from "@tanstack/react-query";
import { randomKey } from "../lib/ids";
import { ApiError, problemFrom } from "../lib/problems";
import type { Campaign } from "./types";

export function pathOf(campaignId: number, file: "report.html" | "report.pdf" | "bundle"): string {
  return `/api/campaigns/${campaignId}/${file}`;
}

/** What the server answers; its refusal, or that it is away, as an error that can be shown. */
async function asked(path: string, init?: RequestInit): Promise<Response> {
  const response = await fetch(path, init).catch(() => undefined);
  if (response?.ok) return response;
  throw new ApiError(problemFrom(response?.status, await response?.json().catch(() => null)));
}

/** Have the report printed, which takes some seconds, and save it. */
export function usePdf(campaignId: number) {
  return useMutation({
    mutationFn: async () => {
      const response = await asked(pathOf(campaignId, "report.pdf"));
      const link = document.createElement("a");
      link.href = URL.createObjectURL(await response.blob());
      link.download = `campaign-${campaignId}-report.pdf`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
    },
  });
}

export function useBringIn() {
  const queries = useQueryClient();
  return useMutation({
    mutationFn: async (file: File) => {
      const body = new FormData();
      body.set("file", file);
      const headers = { "Idempotency-Key": randomKey() };
      return (await (await asked("/api/bundles", { method: "POST", body, headers })).json()) as Campaign;
    },
    onSuccess: () => queries.invalidateQueries({ queryKey: ["campaigns"] }),
  });
}
