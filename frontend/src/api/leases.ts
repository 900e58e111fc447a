/** Operator leases that this tab holds, kept for its session. */

import { useSyncExternalStore } from "react";
import { Store } from "./store";

export interface OwnLease {
  operator: string;
  token: string;
}

const KEY = "gainline-control";

function isLease(value: unknown): value is OwnLease {
  if (typeof value !== "object" || value === null) return false;
  const { operator, token } = value as Record<string, unknown>;
  return typeof operator === "string" && typeof token === "string";
}

function remembered(): Map<number, OwnLease> {
  const kept: unknown = JSON.parse(sessionStorage.getItem(KEY) ?? "{}");
  const entries = Object.entries(typeof kept === "object" && kept !== null ? kept : {});
  return new Map(entries.flatMap(([id, lease]) => (isLease(lease) ? [[Number(id), lease]] : [])));
}

const leases = new Store<ReadonlyMap<number, OwnLease>>(remembered());

function keep(next: ReadonlyMap<number, OwnLease>): void {
  sessionStorage.setItem(KEY, JSON.stringify(Object.fromEntries(next)));
  leases.set(next);
}

export function holdLease(vehicleId: number, lease: OwnLease): void {
  keep(new Map([...leases.get(), [vehicleId, lease]]));
}

export function dropLease(vehicleId: number): void {
  keep(new Map([...leases.get()].filter(([id]) => id !== vehicleId)));
}

export function leasesNow(): ReadonlyMap<number, OwnLease> {
  return leases.get();
}

export function useOwnLease(vehicleId: number | null): OwnLease | null {
  return useSyncExternalStore(leases.subscribe, () =>
    vehicleId === null ? null : (leases.get().get(vehicleId) ?? null),
  );
}

/** The header that proves control of a vehicle; empty without a lease. */
export function controlHeader(vehicleId: number): Record<string, string> {
  const lease = leases.get().get(vehicleId);
  return lease === undefined ? {} : { "X-Gainline-Control": lease.token };
}
