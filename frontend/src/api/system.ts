/** The server itself: where it is reached, what it holds. */

import { useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getSystem } from "./generated";

export type { System } from "./generated";

/** Disk and addresses change without an event, so they are read whenever they are looked at. */
export function useSystem() {
  return useQuery({ queryKey: ["system"], queryFn: () => answer(getSystem()), staleTime: 0 });
}

export const BACKUP = "/api/system/backup";

export function codeOf(address: string): string {
  return `/api/system/qr.svg?address=${encodeURIComponent(address)}`;
}
