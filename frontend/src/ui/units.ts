/** In which units a campaign's numbers stand and what its gains are called, from its experiment. */

import type { Catalogue } from "../api/types";

export interface Units {
  error: string;
  output: string;
  /** Of the gains; empty when they have several. */
  gains: string;
  /** Where the scored output is to go, in its unit. */
  setPoint: number;
}

const TAKEOFF: Units = { error: "m", output: "m", gains: "counts", setPoint: 3 };

/** Those of the experiment; of the takeoff until the catalogue is there. */
export function unitsOf(catalogue: Catalogue | undefined, experiment: string): Units {
  const found = catalogue?.experiments.find(({ name }) => name === experiment);
  if (found === undefined) return TAKEOFF;
  const units = new Set(found.gains.map(({ unit }) => unit));
  return {
    error: found.error_unit,
    output: found.output_unit,
    gains: units.size === 1 ? ([...units][0] ?? "") : "",
    setPoint: found.output_unit === TAKEOFF.output ? TAKEOFF.setPoint : 0,
  };
}

/** What a gain is, by its name: `theta_1` is "Thrust per speed". Empty until the catalogue is there. */
export function gainTitles(catalogue: Catalogue | undefined, experiment: string): Readonly<Record<string, string>> {
  const found = catalogue?.experiments.find(({ name }) => name === experiment);
  return Object.fromEntries((found?.gains ?? []).map(({ name, title }) => [name, title]));
}
