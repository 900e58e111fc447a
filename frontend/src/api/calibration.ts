import { keepPreviousData, useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { getCalibration, getVehicleFigure } from "./generated";
import type { Theme } from "./queries";

export function useCalibration(vehicleId: number) {
  return useQuery({
    queryKey: ["wear", vehicleId, "calibration"],
    queryFn: () => answer(getCalibration({ path: { vehicle_id: vehicleId } })),
  });
}

export function useVehicleFigure(vehicleId: number, name: "calibration" | "batteries", theme: Theme) {
  return useQuery({
    queryKey: ["wear", vehicleId, name, theme],
    queryFn: () => answer(getVehicleFigure({ path: { vehicle_id: vehicleId, name }, query: { theme } })),
    placeholderData: keepPreviousData,
  });
}
