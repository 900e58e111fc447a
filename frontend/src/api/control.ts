/** Requests for operator leases of vehicles: taken, renewed while the tab is open, released. */

import { useMutation, useQueryClient } from "@tanstack/react-query";
import { useEffect } from "react";
import { answer } from "./client";
import { giveUpControl, takeControl } from "./generated";
import { dropLease, holdLease, leasesNow, type OwnLease } from "./leases";
import { problemOf } from "./problems";
import { useVehicleChanged } from "./vehicles";

const RENEW_MS = 5000;

async function ask(vehicleId: number, operator: string, takeOver: boolean): Promise<OwnLease> {
  const own = leasesNow().get(vehicleId);
  const body = { operator, take_over: takeOver, ...(own === undefined ? {} : { token: own.token }) };
  const lease = await answer(takeControl({ path: { vehicle_id: vehicleId }, body }));
  return { operator: lease.operator, token: lease.token };
}

/** A refusal ends the lease, because another operator has it. An unreachable server may return within the lease. */
async function renew(vehicleId: number, { operator }: OwnLease): Promise<boolean> {
  try {
    holdLease(vehicleId, await ask(vehicleId, operator, false));
    return true;
  } catch (error) {
    const status = problemOf(error)?.status ?? 0;
    if (status < 400 || status >= 500) return true;
    dropLease(vehicleId);
    return false;
  }
}

/** Renew the leases of this tab while it is open. */
export function useRenewedControl(): void {
  const queries = useQueryClient();
  useEffect(() => {
    async function renewAll(): Promise<void> {
      const kept = await Promise.all([...leasesNow()].map(([vehicleId, lease]) => renew(vehicleId, lease)));
      if (kept.includes(false)) await queries.invalidateQueries({ queryKey: ["vehicles"] });
    }
    const renewAgain = (): void => void renewAll();
    renewAgain();
    const renewing = setInterval(renewAgain, RENEW_MS);
    document.addEventListener("visibilitychange", renewAgain);
    return () => {
      clearInterval(renewing);
      document.removeEventListener("visibilitychange", renewAgain);
    };
  }, [queries]);
}

export function useTakeControl(vehicleId: number) {
  const changed = useVehicleChanged();
  return useMutation({
    mutationFn: ({ operator, takeOver }: { operator: string; takeOver: boolean }) => ask(vehicleId, operator, takeOver),
    onSuccess: (lease) => holdLease(vehicleId, lease),
    onSettled: () => changed(vehicleId),
  });
}

export function useReleaseControl(vehicleId: number) {
  const changed = useVehicleChanged();
  return useMutation({
    mutationFn: () => answer(giveUpControl({ path: { vehicle_id: vehicleId } })),
    onSuccess: () => dropLease(vehicleId),
    onSettled: () => changed(vehicleId),
  });
}
