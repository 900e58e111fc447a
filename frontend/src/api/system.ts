/** The server: addresses, disk usage, version. */

import { useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getSystem } from "./generated";

export type { System } from "./generated";

/** Disk usage and addresses change without an event, so they are refetched on every visit. */
export function useSystem() {
  return useQuery({ queryKey: ["system"], queryFn: () => answer(getSystem()), staleTime: 0 });
}

export const BACKUP = "/api/system/backup";

export function codeOf(address: string): string {
  return `/api/system/qr.svg?address=${encodeURIComponent(address)}`;
}
