/** Files that the server makes or takes: reports, bundles, backups. */

import { useMutation, useQueryClient } from "@tanstack/react-query";
import { useNavigate } from "react-router";
import { fileNameIn } from "./fileName";
import { randomKey } from "./ids";
import { ApiError, problemFrom } from "./problems";
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

/** Save what the server makes, under the name that it gives it, or say why it makes nothing: a link with `download`
 * would hide that. */
export function useDownload(path: string) {
  return useMutation({
    mutationFn: async () => {
      const response = await asked(path);
      const link = document.createElement("a");
      link.href = URL.createObjectURL(await response.blob());
      link.download = fileNameIn(response.headers.get("Content-Disposition"));
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
    },
  });
}

/** The page of the campaign opens then. Here and not where it was asked for: an empty list is another page as soon as
 * the campaign is known, and would not hear of it. */
export function useImportBundle() {
  const queries = useQueryClient();
  const navigate = useNavigate();
  return useMutation({
    mutationFn: async (file: File) => {
      const body = new FormData();
      body.set("file", file);
      const headers = { "Idempotency-Key": randomKey() };
      return (await (await asked("/api/bundles", { method: "POST", body, headers })).json()) as Campaign;
    },
    onSuccess: ({ id }) => {
      void navigate(`/campaigns/${id}`);
      return queries.invalidateQueries({ queryKey: ["campaigns"] });
    },
  });
}
