/** A campaign's settings as title and value, for people. */

import type { Campaign } from "../api/types";
import { gainsInBrackets } from "./gains";

const STARTS = {
  default: "The vehicle's default gains",
  simplex: "Simplex on the model",
  given: "Given gains",
} as const;

function percent(share: number): string {
  return `${Number((100 * share).toFixed(1))} %`;
}

export function settingsOf({ definition, vehicle, definition_digest }: Campaign): [string, string][] {
  const { stop, start } = definition;
  const rows: [string, string][] = [
    ["Vehicle", vehicle.title],
    ...Object.entries(vehicle.options).map(([name, value]): [string, string] => [`Vehicle: ${name}`, String(value)]),
    ["Experiment", definition.experiment],
    ["Strategy", definition.strategy],
    ...Object.entries(definition.options ?? {}).map(([name, value]): [string, string] => [
      `Strategy: ${name}`,
      String(value),
    ]),
    ["Start", start?.gains ? gainsInBrackets(start.gains) : STARTS[start?.kind ?? "default"]],
    [
      "Stop",
      stop?.kind === "budget"
        ? `After ${stop.max_flights} flights`
        : `Two flights in a row less than ${percent(stop?.improvement ?? 0)} better than the best, or ${stop?.max_flights} flights`,
    ],
    ...Object.entries(definition.bounds ?? {}).map(([name, [low, high]]): [string, string] => [
      `Bounds of ${name}`,
      `${low} … ${high}`,
    ]),
    [
      "Largest step",
      `${percent(definition.first_step_fraction ?? 0)} of each range until a flight is valid, then ${percent(definition.step_fraction ?? 0)}`,
    ],
    ["Seed", String(definition.seed)],
  ];
  if (definition_digest) rows.push(["Frozen as", definition_digest.slice(0, 12)]);
  return rows;
}
