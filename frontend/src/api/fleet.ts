/** Registration, requests and gain history of vehicles. */

import { useMutation } from "@tanstack/react-query";
import { answer } from "./client";
import {
  checkVehicle,
  connectVehicle,
  deleteVehicle,
  disconnectVehicle,
  editVehicle,
  listActs,
  listGivenGains,
  type NewVehicle,
  readParameters,
  registerVehicle,
  releaseVehicle,
  restoreSafeGains,
  type Vehicle,
  type VehicleEdit,
} from "./generated";
import { controlHeader } from "./leases";
import { usePages } from "./pages";
import { useVehicleChanged } from "./vehicles";

const SHOWN = 20;

export function useRegisterVehicle() {
  const changed = useVehicleChanged();
  return useMutation({
    mutationFn: (body: NewVehicle) => answer(registerVehicle({ body })),
    onSuccess: ({ id }) => changed(id),
  });
}

interface ToVehicle {
  path: { vehicle_id: number };
  headers: ReturnType<typeof controlHeader>;
}

/** A request to a vehicle, after which everything about it is read again. */
function useRequest<Sent, Answer>(vehicleId: number, send: (sent: Sent, to: ToVehicle) => Promise<Answer>) {
  const changed = useVehicleChanged();
  return useMutation({
    mutationFn: (sent: Sent) => send(sent, { path: { vehicle_id: vehicleId }, headers: controlHeader(vehicleId) }),
    onSettled: () => changed(vehicleId),
  });
}

export function useEditVehicle(vehicleId: number) {
  return useRequest(vehicleId, (body: VehicleEdit, to) => answer(editVehicle({ ...to, body })));
}

/** Delete the vehicle as it was read; `onDeleted` is called even if its page is gone by then. */
export function useDeleteVehicle({ id, version }: Vehicle, onDeleted: () => void) {
  const changed = useVehicleChanged();
  return useMutation({
    mutationFn: () =>
      answer(deleteVehicle({ path: { vehicle_id: id }, query: { version }, headers: controlHeader(id) })),
    onSuccess: onDeleted,
    onSettled: () => void changed(id),
  });
}

export function useRelease(vehicleId: number) {
  return useRequest(vehicleId, (statement: string, to) => answer(releaseVehicle({ ...to, body: { statement } })));
}

const ACTS = {
  connect: connectVehicle,
  disconnect: disconnectVehicle,
  check: checkVehicle,
  restore: restoreSafeGains,
  parameters: readParameters,
} as const;

export type VehicleRequest = keyof typeof ACTS;

/** Send a request to a vehicle; its outcome appears in the list of acts. */
export function useVehicleRequest(vehicleId: number) {
  return useRequest(vehicleId, (act: VehicleRequest, to) => answer(ACTS[act](to)));
}

/** What was asked of the vehicle, newest first. */
export function useActs(vehicleId: number) {
  return usePages(["vehicle", vehicleId, "acts"], SHOWN, (query) =>
    answer(listActs({ path: { vehicle_id: vehicleId }, query })),
  );
}

/** The gains given to the vehicle, newest first. */
export function useLedger(vehicleId: number) {
  return usePages(["vehicle", vehicleId, "ledger"], SHOWN, (query) =>
    answer(listGivenGains({ path: { vehicle_id: vehicleId }, query })),
  );
}
