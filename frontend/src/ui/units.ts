/** Units and gain names of a campaign, from its experiment. */

import { useCatalogue } from "../api/queries";
import type { Catalogue } from "../api/types";

export interface Units {
  error: string;
  output: string;
  /** Of the gains; empty when they have several. */
  gains: string;
  /** Set point of the scored output, in its unit. */
  setPoint: number;
}

const TAKEOFF: Units = { error: "m", output: "m", gains: "counts", setPoint: 3 };

export function experimentOf(catalogue: Catalogue | undefined, experiment: string) {
  return catalogue?.experiments.find(({ name }) => name === experiment);
}

/** Units of the experiment; those of the takeoff until the catalogue is loaded. */
export function unitsOf(catalogue: Catalogue | undefined, experiment: string): Units {
  const found = experimentOf(catalogue, experiment);
  if (found === undefined) return TAKEOFF;
  const units = new Set(found.gains.map(({ unit }) => unit));
  return {
    error: found.error_unit,
    output: found.output_unit,
    gains: units.size === 1 ? ([...units][0] ?? "") : "",
    setPoint: found.output_unit === TAKEOFF.output ? TAKEOFF.setPoint : 0,
  };
}

/** Titles of gains by name: `theta_1` is "Thrust per speed". Empty until the catalogue is loaded. */
export function gainTitles(catalogue: Catalogue | undefined, experiment: string): Readonly<Record<string, string>> {
  const { gains = [] } = experimentOf(catalogue, experiment) ?? {};
  return Object.fromEntries(gains.map(({ name, title }) => [name, title]));
}

/** Whether errors can be predicted: there is a model of the controller. True until the catalogue is loaded. */
export function useHasModel(experiment: string): boolean {
  return experimentOf(useCatalogue().data, experiment)?.has_model ?? true;
}

/** Experiments that a new campaign can have: those that a kind of vehicle flies. */
export function offeredExperiments({ experiments, vehicle_kinds }: Catalogue) {
  return experiments.filter(({ name }) => vehicle_kinds.some((kind) => kind.experiments.includes(name)));
}

/** Title of the experiment that new campaigns fly instead of this one, with gains of the same autopilot; undefined
 * while this one is offered. */
export function replacementOf(catalogue: Catalogue, experiment: string): string | undefined {
  const offered = offeredExperiments(catalogue);
  if (offered.some(({ name }) => name === experiment)) return undefined;
  const own = catalogue.autopilots.find(({ experiments }) => experiments.includes(experiment));
  return offered.find(({ name }) => own?.experiments.includes(name))?.title;
}

export function useUnits(experiment: string): Units {
  return unitsOf(useCatalogue().data, experiment);
}

export function useGainTitles(experiment: string): Readonly<Record<string, string>> {
  return gainTitles(useCatalogue().data, experiment);
}
