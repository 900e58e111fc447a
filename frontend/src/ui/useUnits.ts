import { useCatalogue } from "../api/queries";
import { gainTitles, type Units, unitsOf } from "./units";

export function useUnits(experiment: string): Units {
  return unitsOf(useCatalogue().data, experiment);
}

export function useGainTitles(experiment: string): Readonly<Record<string, string>> {
  return gainTitles(useCatalogue().data, experiment);
}
