/** What pages read of vehicles. Keys are what `live/staleQueries.ts` makes stale. */

import { useQuery, useQueryClient } from "@tanstack/react-query";
import { answer } from "./client";
import { listVehicles, type PageVehicle, type Vehicle } from "./generated";

const LARGEST_PAGE = 200;
/** Nobody is told that a lease has run out, so whoever shows one asks again. */
const CONTROL_MS = 10_000;

async function allVehicles(): Promise<Vehicle[]> {
  const vehicles: Vehicle[] = [];
  let cursor: string | null = null;
  do {
    const query: { limit: number; cursor?: string } = { limit: LARGEST_PAGE, ...(cursor === null ? {} : { cursor }) };
    const page: PageVehicle = await answer(listVehicles({ query }));
    vehicles.push(...page.items);
    cursor = page.next_cursor;
  } while (cursor !== null);
  return vehicles;
}

/** Every vehicle: the registered ones, and the simulations that campaigns share. */
export function useVehicles() {
  return useQuery({
    queryKey: ["vehicles"],
    queryFn: allVehicles,
    refetchInterval: ({ state }) => (state.data?.some(({ control }) => control !== null) ? CONTROL_MS : false),
  });
}

/** One vehicle out of the list of all, which every page has. */
export function useVehicle(vehicleId: number | null): Vehicle | null {
  return useVehicles().data?.find(({ id }) => id === vehicleId) ?? null;
}

/** What an act on a vehicle makes doubtful: to be called once it is over. */
export function useVehicleChanged() {
  const queries = useQueryClient();
  return (vehicleId: number): Promise<unknown> =>
    Promise.all([
      queries.invalidateQueries({ queryKey: ["vehicles"] }),
      queries.invalidateQueries({ queryKey: ["vehicle", vehicleId] }),
    ]);
}
