/** A campaign's settings as title and value, for people. */

import type { Campaign, Catalogue } from "../api/types";
import { gainsInBrackets } from "./gains";

const STARTS = {
  default: "The vehicle's default gains",
  simplex: "Simplex on the model",
  given: "Given gains",
} as const;

const CLOSE_UNITS = ["°", "×"];

type Row = [title: string, value: string];

interface Described {
  name: string;
  title: string;
  unit?: string;
}

function percent(share: number): string {
  return `${Number((100 * share).toFixed(1))} %`;
}

function said(value: unknown, unit = ""): string {
  if (typeof value === "boolean") return value ? "yes" : "no";
  const gap = unit === "" || CLOSE_UNITS.includes(unit) ? "" : " ";
  return `${value}${gap}${unit}`;
}

/** Options under the titles and in the units that the catalogue gives them; under their names until it is there. */
function optionRows(options: Record<string, unknown>, known: readonly Described[] = []): Row[] {
  return Object.entries(options).map(([name, value]) => {
    const found = known.find((one) => one.name === name);
    return [found?.title ?? name, said(value, found?.unit)];
  });
}

function named(things: readonly Described[] | undefined, name: string): string {
  return things?.find((thing) => thing.name === name)?.title ?? name;
}

export function settingsOf({ definition, vehicle, definition_digest }: Campaign, catalogue?: Catalogue): Row[] {
  const { stop, start } = definition;
  const kind = catalogue?.vehicle_kinds.find(({ name }) => name === vehicle.kind);
  const strategy = catalogue?.strategies.find(({ name }) => name === definition.strategy);
  const gains = catalogue?.experiments.find(({ name }) => name === definition.experiment)?.gains;
  const unitOf = (name: string): string => gains?.find((gain) => gain.name === name)?.unit ?? "";
  const rows: Row[] = [
    ["Vehicle", vehicle.title],
    ...optionRows(vehicle.options, kind?.options),
    ["Experiment", named(catalogue?.experiments, definition.experiment)],
    ["Strategy", named(catalogue?.strategies, definition.strategy)],
    ...optionRows(definition.options ?? {}, strategy?.options),
    ["Start", start?.gains ? gainsInBrackets(start.gains) : STARTS[start?.kind ?? "default"]],
    [
      "Stop",
      stop?.kind === "budget"
        ? `After ${stop.max_flights} flights`
        : `Two flights in a row less than ${percent(stop?.improvement ?? 0)} better than the best, or ${stop?.max_flights} flights`,
    ],
    ...Object.entries(definition.bounds ?? {}).map(
      ([name, [low, high]]): Row => [`Bounds of ${name}`, said(`${low} … ${high}`, unitOf(name))],
    ),
    [
      "Largest step",
      `${percent(definition.first_step_fraction ?? 0)} of each range until a flight is valid, then ${percent(definition.step_fraction ?? 0)}`,
    ],
    ["Seed", String(definition.seed)],
  ];
  if (definition_digest) rows.push(["Frozen as", definition_digest.slice(0, 12)]);
  return rows;
}
