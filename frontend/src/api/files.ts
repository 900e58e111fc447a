/** Files that the server creates or imports: reports, bundles, backups. */

import { useMutation, useQueryClient } from "@tanstack/react-query";
import { navigate } from "wouter/use-browser-location";
import { randomKey } from "./client";
import { ApiError, problemFrom } from "./problems";
import type { Campaign } from "./types";

export function pathOf(campaignId: number, file: "report.html" | "report.pdf" | "bundle" | "parameter-file"): string {
  return `/api/campaigns/${campaignId}/${file}`;
}

/** Fetch a response; throws ApiError if it is refused or the server cannot be reached. */
async function asked(path: string, init?: RequestInit): Promise<Response> {
  const response = await fetch(path, init).catch(() => undefined);
  if (response?.ok) return response;
  throw new ApiError(problemFrom(response?.status, await response?.json().catch(() => null)));
}

/** Download a file under the server's name for it, and report errors, which a link with `download` would hide. */
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

/** Import a bundle and open its campaign. Navigates here because the calling component may be unmounted by then: the
 * empty list is replaced as soon as the campaign is known. */
export function useImportBundle() {
  const queries = useQueryClient();
  return useMutation({
    mutationFn: async (file: File) => {
      const body = new FormData();
      body.set("file", file);
      const headers = { "Idempotency-Key": randomKey() };
      return (await (await asked("/api/bundles", { method: "POST", body, headers })).json()) as Campaign;
    },
    onSuccess: ({ id }) => {
      navigate(`/campaigns/${id}`);
      return queries.invalidateQueries({ queryKey: ["campaigns"] });
    },
  });
}

/** The file name in a Content-Disposition header; empty if it has none. */
export function fileNameIn(disposition: string | null): string {
  const [, encoded, plain] = /filename\*=utf-8''([^;]+)|filename="([^"]*)"/i.exec(disposition ?? "") ?? [];
  return encoded === undefined ? (plain ?? "") : decodeURIComponent(encoded);
}
