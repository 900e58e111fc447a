/** A campaign's settings as titles and values. */

import type { Campaign, Catalogue, Definition, OptionInfo } from "../../api/types";
import { count, percentText, unitAfter } from "../../ui/format";
import { gainsInBrackets } from "../../ui/gains";
import { experimentOf } from "../../ui/units";
import { STARTS } from "../new-campaign/newCampaign";

const CLOSE_UNITS = ["°", "×"];

type Row = [title: string, value: string];

function percent(share: number): string {
  return percentText(100 * share, 1);
}

function valueText(value: unknown, unit = ""): string {
  if (typeof value === "boolean") return value ? "yes" : "no";
  return `${value}${CLOSE_UNITS.includes(unit) ? unit : unitAfter(unit)}`;
}

/** Options with the titles and units of the catalogue; with their names until it is loaded. */
function optionRows(options: Record<string, unknown>, known: readonly OptionInfo[] = []): Row[] {
  return Object.entries(options).map(([name, value]) => {
    const found = known.find((one) => one.name === name);
    return [found?.title ?? name, valueText(value, found?.unit)];
  });
}

/** Options that differ from the vehicle's defaults, and those that are not known. */
function changedOptions(options: Record<string, unknown>, known: readonly OptionInfo[] = []): Record<string, unknown> {
  const defaults = new Map<string, unknown>(known.map((option) => [option.name, option.default]));
  return Object.fromEntries(Object.entries(options).filter(([name, value]) => defaults.get(name) !== value));
}

function stopText(stop: Definition["stop"], openUntilFlight: number): string {
  const { max_flights: flights } = stop;
  const further = openUntilFlight > flights ? ` and ${openUntilFlight - flights} more after reopening` : "";
  const most = `${count(flights, "flight")}${further}, invalid ones not counted`;
  switch (stop.kind) {
    case "budget":
      return `After ${most}`;
    case "noise":
      return `No resolvable improvement at ${percent(stop.confidence)} confidence, or ${most}`;
    default:
      return `Two consecutive flights less than ${percent(stop.improvement)} better than the best, or ${most}`;
  }
}

function startText(start: Definition["start"]): string {
  if (start.donor && start.gains) {
    return `${gainsInBrackets(start.gains)}, flight ${start.donor.trial_number} of campaign ${start.donor.campaign_id}`;
  }
  return start.gains ? gainsInBrackets(start.gains) : STARTS[start.kind];
}

/** All settings of the experiment: those of the definition, the others at their defaults. */
function experimentOptions(definition: Definition, catalogue?: Catalogue): Record<string, unknown> {
  const offered = experimentOf(catalogue, definition.experiment)?.options ?? [];
  const defaults = Object.fromEntries(offered.map(({ name, default: standard }) => [name, standard]));
  return { ...defaults, ...definition.experiment_options };
}

/** Scored time after the takeoff command, s; null for an experiment without this setting, and until the catalogue is
 * loaded. */
export function windowOf(definition: Definition, catalogue?: Catalogue): number | null {
  const seconds = experimentOptions(definition, catalogue)["window_s"];
  return typeof seconds === "number" ? seconds : null;
}

export function settingsOf(campaign: Campaign, catalogue?: Catalogue): Row[] {
  const { definition, vehicle, definition_digest: digest, open_until_flight } = campaign;
  const { stop, start } = definition;
  const kind = catalogue?.vehicle_kinds.find(({ name }) => name === vehicle.kind);
  const strategy = catalogue?.strategies.find(({ name }) => name === definition.strategy);
  const experiment = experimentOf(catalogue, definition.experiment);
  const unitOf = (name: string): string => experiment?.gains.find((gain) => gain.name === name)?.unit ?? "";
  const bounds = Object.entries(definition.bounds);
  const rows: (Row | false)[] = [
    ["Vehicle", vehicle.title],
    ...optionRows(changedOptions(vehicle.options, kind?.options), kind?.options),
    ["Experiment", experiment?.title ?? definition.experiment],
    ...optionRows(experimentOptions(definition, catalogue), experiment?.options),
    ["Strategy", strategy?.title ?? definition.strategy],
    ...optionRows(definition.options, strategy?.options),
    ["Start", startText(start)],
    ["Stop rule", stopText(stop, open_until_flight)],
    Boolean(stop.min_battery_v) && ["Minimum battery voltage", `${stop.min_battery_v} V after a flight`],
    ...bounds.map(([name, [low, high]]): Row => [`Bounds of ${name}`, valueText(`${low} … ${high}`, unitOf(name))]),
    [
      "Maximum step",
      `${percent(definition.first_step_fraction)} of each gain's range until the first valid flight, then ${percent(definition.step_fraction)}`,
    ],
    Boolean(definition.ceiling_m) && experiment?.output_unit === "m" && ["Gate ceiling", `${definition.ceiling_m} m`],
    vehicle.can_fly && !vehicle.registered && ["Seed", String(definition.seed)],
    Boolean(digest) && ["Definition digest", `${digest}`.slice(0, 12)],
  ];
  return rows.filter((row) => row !== false);
}
