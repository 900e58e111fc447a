/** Queries of vehicles. `live/staleQueries.ts` invalidates them by their keys. */

import { useQuery, useQueryClient } from "@tanstack/react-query";
import { answer } from "./client";
import { getCalibration, getVehicleFigure, listVehicles, type Vehicle } from "./generated";
import { everyPage } from "./pages";
import { useFigure } from "./queries";

/** The expiry of a lease causes no event, so a shown lease is polled. */
const CONTROL_MS = 10_000;

/** All vehicles: registered ones and shared simulations. */
export function useVehicles() {
  return useQuery({
    queryKey: ["vehicles"],
    queryFn: () => everyPage((query) => answer(listVehicles({ query }))),
    refetchInterval: ({ state }) => (state.data?.some(({ control }) => control !== null) ? CONTROL_MS : false),
  });
}

/** One vehicle from the list of all, which every page has. */
export function useVehicle(vehicleId: number | null): Vehicle | null {
  return useVehicles().data?.find(({ id }) => id === vehicleId) ?? null;
}

/** Invalidates the queries of a vehicle after an action. */
export function useVehicleChanged() {
  const queries = useQueryClient();
  return (vehicleId: number): Promise<unknown> =>
    Promise.all([
      queries.invalidateQueries({ queryKey: ["vehicles"] }),
      queries.invalidateQueries({ queryKey: ["vehicle", vehicleId] }),
    ]);
}

export function useCalibration(vehicleId: number) {
  return useQuery({
    queryKey: ["history", vehicleId, "calibration"],
    queryFn: () => answer(getCalibration({ path: { vehicle_id: vehicleId } })),
  });
}

export function useVehicleFigure(vehicleId: number, name: "calibration" | "batteries") {
  return useFigure(["history", vehicleId, name], (theme) =>
    answer(getVehicleFigure({ path: { vehicle_id: vehicleId, name }, query: { theme } })),
  );
}
