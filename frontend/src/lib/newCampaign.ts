/** The form of a new campaign: working defaults in, the request out. Number fields hold text while they are empty. */

import type { Catalogue, NewCampaign, PresetInfo, VehicleKindInfo } from "../api/types";

export type Entry = number | string;
export type OptionValue = boolean | number | string;
export type StartKind = "default" | "simplex" | "given";
export type StopKind = "paper" | "budget";

export interface CampaignForm {
  name: string;
  vehicle: string;
  vehicleOptions: Record<string, OptionValue>;
  strategy: string;
  strategyOptions: Record<string, OptionValue>;
  start: StartKind;
  startGains: Record<string, Entry>;
  stop: StopKind;
  maxFlights: Entry;
  improvementPercent: Entry;
  bounds: Record<string, [Entry, Entry]>;
  firstStepPercent: Entry;
  stepPercent: Entry;
  seed: Entry;
}

const EXPERIMENT = "takeoff";

export function gainsOf(catalogue: Catalogue) {
  return catalogue.experiments.find(({ name }) => name === EXPERIMENT)?.gains ?? [];
}

export function nameFor(catalogue: Catalogue, vehicle: string): string {
  const preset = catalogue.presets.find((one) => one.campaign.vehicle.kind === vehicle);
  return preset?.title ?? `Takeoff, ${vehicle}`;
}

/** The preset that one click creates: the simulated takeoff. */
export function firstPreset(catalogue: Catalogue): PresetInfo | undefined {
  return catalogue.presets.find(({ campaign }) => campaign.vehicle.kind === "jsbsim") ?? catalogue.presets[0];
}

/** The simulation comes first, a vehicle that is flown elsewhere last. */
export function vehicleOrder(kinds: readonly VehicleKindInfo[]): VehicleKindInfo[] {
  const rank = (kind: VehicleKindInfo): number => (kind.name === "jsbsim" ? 0 : kind.can_fly ? 1 : 2);
  return [...kinds].sort((one, other) => rank(one) - rank(other));
}

export function startingForm(catalogue: Catalogue): CampaignForm {
  const vehicle = vehicleOrder(catalogue.vehicle_kinds)[0]?.name ?? "";
  const gains = gainsOf(catalogue);
  return {
    name: nameFor(catalogue, vehicle),
    vehicle,
    vehicleOptions: {},
    strategy: "gradient",
    strategyOptions: {},
    start: "default",
    startGains: Object.fromEntries(gains.map((gain) => [gain.name, gain.default])),
    stop: "paper",
    maxFlights: 7,
    improvementPercent: 5,
    bounds: Object.fromEntries(gains.map((gain) => [gain.name, [gain.lower, gain.upper]])),
    firstStepPercent: 25,
    stepPercent: 100,
    seed: 1,
  };
}

/** Another vehicle has other settings; a name that nobody has changed follows it. */
export function withVehicle(form: CampaignForm, catalogue: Catalogue, vehicle: string): CampaignForm {
  const named = form.name !== nameFor(catalogue, form.vehicle);
  return { ...form, vehicle, vehicleOptions: {}, name: named ? form.name : nameFor(catalogue, vehicle) };
}

function number(entry: Entry, fallback: number): number {
  return entry === "" ? fallback : Number(entry);
}

function share(entry: Entry, fallback: number): number {
  return entry === "" ? fallback : Number((Number(entry) / 100).toPrecision(12));
}

/** Only what differs from the experiment's own bounds narrows them. */
function narrowed(form: CampaignForm, catalogue: Catalogue): Record<string, [number, number]> {
  const bounds: Record<string, [number, number]> = {};
  for (const gain of gainsOf(catalogue)) {
    const [low, high] = form.bounds[gain.name] ?? [gain.lower, gain.upper];
    const pair: [number, number] = [number(low, gain.lower), number(high, gain.upper)];
    if (pair[0] !== gain.lower || pair[1] !== gain.upper) bounds[gain.name] = pair;
  }
  return bounds;
}

export function requestFrom(form: CampaignForm, catalogue: Catalogue): NewCampaign {
  const given = Object.fromEntries(
    Object.entries(form.startGains).flatMap(([name, entry]) => (entry === "" ? [] : [[name, Number(entry)]])),
  );
  return {
    name: form.name,
    vehicle: { kind: form.vehicle, options: form.vehicleOptions },
    definition: {
      experiment: EXPERIMENT,
      strategy: form.strategy,
      options: form.strategyOptions,
      start: form.start === "given" ? { kind: "given", gains: given } : { kind: form.start },
      bounds: narrowed(form, catalogue),
      first_step_fraction: share(form.firstStepPercent, 0.25),
      step_fraction: share(form.stepPercent, 1),
      stop: {
        kind: form.stop,
        max_flights: number(form.maxFlights, 7),
        improvement: share(form.improvementPercent, 0.05),
      },
      seed: number(form.seed, 1),
    },
  };
}

/** The names under which the server refuses a field, as far as the form shows it: first the plain ones. */
export function fieldsOf(form: CampaignForm, catalogue: Catalogue): { plain: string[]; advanced: string[] } {
  const gains = gainsOf(catalogue).map(({ name }) => name);
  const options = catalogue.vehicle_kinds.find(({ name }) => name === form.vehicle)?.options ?? [];
  const strategy = catalogue.strategies.find(({ name }) => name === form.strategy)?.options ?? [];
  return {
    plain: [
      "name",
      "vehicle.kind",
      "strategy",
      "start.kind",
      ...(form.start === "given" ? gains.map((name) => `start.gains.${name}`) : []),
    ],
    advanced: [
      ...strategy.map(({ name }) => `definition.options.${name}`),
      "stop.max_flights",
      "stop.improvement",
      ...gains.map((name) => `bounds.${name}`),
      "first_step_fraction",
      "step_fraction",
      ...options.map(({ name }) => `vehicle.options.${name}`),
      "seed",
    ],
  };
}
