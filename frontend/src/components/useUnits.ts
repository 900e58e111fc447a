import { useCatalogue } from "../api/queries";
import { type Units, unitsOf } from "../lib/units";

export function useUnits(experiment: string): Units {
  return unitsOf(useCatalogue().data, experiment);
}
