/** What people do with vehicles, and what vehicles were asked and given. */

import { useInfiniteQuery, useMutation, useQueryClient } from "@tanstack/react-query";
import { controlHeader } from "../live/leases";
import { answer } from "./client";
import {
  checkVehicle,
  connectVehicle,
  disconnectVehicle,
  editVehicle,
  listActs,
  listGivenGains,
  type NewVehicle,
  readParameters,
  registerVehicle,
  releaseVehicle,
  restoreSafeGains,
  type VehicleEdit,
} from "./generated";

const SHOWN = 20;

function useChanged() {
  const queries = useQueryClient();
  return (vehicleId: number): Promise<unknown> =>
    Promise.all([
      queries.invalidateQueries({ queryKey: ["vehicles"] }),
      queries.invalidateQueries({ queryKey: ["vehicle", vehicleId] }),
    ]);
}

export function useRegisterVehicle() {
  const changed = useChanged();
  return useMutation({
    mutationFn: (body: NewVehicle) => answer(registerVehicle({ body })),
    onSuccess: ({ id }) => changed(id),
  });
}

export function useEditVehicle(vehicleId: number) {
  const changed = useChanged();
  return useMutation({
    mutationFn: (body: VehicleEdit) =>
      answer(editVehicle({ path: { vehicle_id: vehicleId }, body, headers: controlHeader(vehicleId) })),
    onSettled: () => changed(vehicleId),
  });
}

export function useRelease(vehicleId: number) {
  const changed = useChanged();
  return useMutation({
    mutationFn: (statement: string) =>
      answer(
        releaseVehicle({ path: { vehicle_id: vehicleId }, body: { statement }, headers: controlHeader(vehicleId) }),
      ),
    onSettled: () => changed(vehicleId),
  });
}

const ACTS = {
  connect: connectVehicle,
  disconnect: disconnectVehicle,
  check: checkVehicle,
  restore: restoreSafeGains,
  parameters: readParameters,
} as const;

export type Asked = keyof typeof ACTS;

/** Ask a vehicle for one of its acts; what comes of it is seen in the list of its acts. */
export function useAskVehicle(vehicleId: number) {
  const changed = useChanged();
  return useMutation({
    mutationFn: (act: Asked) =>
      answer(ACTS[act]({ path: { vehicle_id: vehicleId }, headers: controlHeader(vehicleId) })),
    onSettled: () => changed(vehicleId),
  });
}

export function useActs(vehicleId: number) {
  return useInfiniteQuery({
    queryKey: ["vehicle", vehicleId, "acts"],
    queryFn: ({ pageParam }) =>
      answer(
        listActs({
          path: { vehicle_id: vehicleId },
          query: { limit: SHOWN, ...(pageParam === null ? {} : { cursor: pageParam }) },
        }),
      ),
    initialPageParam: null as string | null,
    getNextPageParam: ({ next_cursor }) => next_cursor,
  });
}

export function useLedger(vehicleId: number) {
  return useInfiniteQuery({
    queryKey: ["vehicle", vehicleId, "ledger"],
    queryFn: ({ pageParam }) =>
      answer(
        listGivenGains({
          path: { vehicle_id: vehicleId },
          query: { limit: SHOWN, ...(pageParam === null ? {} : { cursor: pageParam }) },
        }),
      ),
    initialPageParam: null as string | null,
    getNextPageParam: ({ next_cursor }) => next_cursor,
  });
}
