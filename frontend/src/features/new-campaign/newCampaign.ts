/**
 * Form of a new campaign: its defaults and its request. Its fields have the request's names. Number fields contain text
 * until it is a valid number.
 */

import { navigate } from "wouter/use-browser-location";
import type {
  CampaignSummary,
  Catalogue,
  Definition,
  Gain,
  NewCampaign,
  PresetInfo,
  Vehicle,
  VehicleKindInfo,
} from "../../api/types";
import { type NumberEntry, numbersOf, type OptionValue } from "../../ui/Fields";
import { experimentOf } from "../../ui/units";

export type StartKind = Definition["start"]["kind"];
export type StopKind = Definition["stop"]["kind"];

/** These settings with text in their number fields. */
type Entered<Settings> = {
  [Name in keyof Settings]: Settings[Name] extends number | null ? NumberEntry : Settings[Name];
};

export interface CampaignForm {
  name: string;
  /** The vehicle, if it is a registered one. */
  registered: Vehicle | null;
  vehicle: { kind: string; options: Record<string, OptionValue> };
  definition: Entered<Omit<Definition, "start" | "stop" | "bounds">> & {
    start: { kind: StartKind; gains: Record<string, NumberEntry>; donor: CampaignSummary | null };
    stop: Entered<Definition["stop"]>;
    bounds: Record<string, [NumberEntry, NumberEntry]>;
  };
}

export function gainsOf(catalogue: Catalogue, experiment: string): readonly Gain[] {
  return experimentOf(catalogue, experiment)?.gains ?? [];
}

/** Where the first gains come from. */
export const STARTS: Record<StartKind, string> = {
  default: "The vehicle's default gains",
  simplex: "Best gains on the model (simplex)",
  campaign: "Best gains of another campaign",
  given: "Custom gains",
};

/** Available sources of the first gains: a search on the model only where it is a strategy too. */
export function startsFor(catalogue: Catalogue, experiment: string): StartKind[] {
  return strategiesFor(catalogue, experiment).some(({ name }) => name === "simplex")
    ? ["default", "simplex", "campaign", "given"]
    : ["default", "campaign", "given"];
}

/** Whether `experiments` includes this one; an empty list means all. */
function fits(experiments: readonly string[], experiment: string): boolean {
  return experiments.length === 0 || experiments.includes(experiment);
}

/** Shared vehicles of this experiment: simulations first, vehicles flown elsewhere last. */
export function kindsFor(catalogue: Catalogue, experiment: string): VehicleKindInfo[] {
  const rank = (kind: VehicleKindInfo): number => (kind.name === "jsbsim" ? 0 : kind.can_fly ? 1 : 2);
  const shared = catalogue.vehicle_kinds.filter((kind) => !kind.registered && fits(kind.experiments, experiment));
  return shared.sort((one, other) => rank(one) - rank(other));
}

/** Opens the page of a campaign that has been created. */
export const openCampaign = ({ id }: { id: number }) => navigate(`/campaigns/${id}`);

/** Entries of the catalogue as choices of a field. */
export function choicesOf(entries: readonly { name: string; title: string }[]) {
  return entries.map(({ name, title }) => ({ value: name, label: title }));
}

/** Registered vehicles that fly this experiment. */
export function registeredFor(vehicles: readonly Vehicle[], experiment: string): Vehicle[] {
  return vehicles.filter(({ registered, experiments }) => registered && fits(experiments, experiment));
}

/** Strategies of this experiment in the catalogue's order; the first is recommended. */
export function strategiesFor(catalogue: Catalogue, experiment: string) {
  return catalogue.strategies.filter((strategy) => fits(strategy.experiments, experiment));
}

/** The preset that one click creates: the simulated takeoff. */
export function firstPreset(catalogue: Catalogue): PresetInfo | undefined {
  return catalogue.presets.find(({ campaign }) => campaign.vehicle.kind === "jsbsim") ?? catalogue.presets[0];
}

/** The name of a campaign that nobody has named. */
function usualName({ registered, vehicle, definition }: CampaignForm, catalogue: Catalogue): string {
  const { experiment } = definition;
  const title = experimentOf(catalogue, experiment)?.title ?? experiment;
  if (registered !== null) return `${title}, ${registered.name}`;
  const preset = catalogue.presets.find(
    ({ campaign }) => campaign.vehicle.kind === vehicle.kind && campaign.definition.experiment === experiment,
  );
  if (preset !== undefined) return preset.title;
  const kind = catalogue.vehicle_kinds.find(({ name }) => name === vehicle.kind);
  return kind === undefined ? title : `${title}, ${kind.can_fly ? kind.title : kind.title.toLowerCase()}`;
}

/** The changed form, with a name that was typed, or that of the change. */
function renamed(
  before: CampaignForm,
  changed: CampaignForm,
  catalogue: Catalogue,
  name = usualName(changed, catalogue),
): CampaignForm {
  const isUsual =
    before.name === usualName(before, catalogue) || catalogue.presets.some(({ title }) => title === before.name);
  return { ...changed, name: isUsual ? name : before.name };
}

export function startingForm(
  catalogue: Catalogue,
  experiment: string = catalogue.experiments[0]?.name ?? "takeoff",
): CampaignForm {
  const gains = gainsOf(catalogue, experiment);
  const form: CampaignForm = {
    name: "",
    registered: null,
    vehicle: { kind: kindsFor(catalogue, experiment)[0]?.name ?? "", options: {} },
    definition: {
      experiment,
      experiment_options: {},
      strategy: strategiesFor(catalogue, experiment)[0]?.name ?? "gradient",
      options: {},
      start: {
        kind: "default",
        gains: Object.fromEntries(gains.map((gain) => [gain.name, gain.default])),
        donor: null,
      },
      stop: { kind: "noise", max_flights: 7, improvement: 0.05, confidence: 0.9, min_battery_v: "" },
      bounds: Object.fromEntries(gains.map((gain) => [gain.name, [gain.lower, gain.upper]])),
      first_step_fraction: 0.25,
      step_fraction: experimentOf(catalogue, experiment)?.has_model ? 1 : 0.25,
      ceiling_m: 4.5,
      seed: 1,
    },
  };
  return { ...form, name: usualName(form, catalogue) };
}

/** Select a preset: replaces everything except an edited name. */
export function withPreset(form: CampaignForm, catalogue: Catalogue, { title, campaign }: PresetInfo): CampaignForm {
  const { definition, vehicle } = campaign;
  const { start, stop } = definition;
  const fresh = startingForm(catalogue, definition.experiment);
  const changed: CampaignForm = {
    ...fresh,
    vehicle: { kind: vehicle.kind, options: vehicle.options },
    definition: {
      ...definition,
      start: { kind: start.kind, gains: { ...fresh.definition.start.gains, ...start.gains }, donor: null },
      stop: { ...stop, min_battery_v: stop.min_battery_v ?? "" },
      bounds: { ...fresh.definition.bounds, ...definition.bounds },
    },
  };
  return renamed(form, changed, catalogue, title);
}

/** The preset whose settings the form has; undefined if they are others. */
export function presetOf(form: CampaignForm, catalogue: Catalogue): PresetInfo | undefined {
  const settings = (one: CampaignForm): string => JSON.stringify({ ...requestFrom(one, catalogue), name: "" });
  return catalogue.presets.find((preset) => settings(withPreset(form, catalogue, preset)) === settings(form));
}

/** Select a shared vehicle by its kind: resets the vehicle settings and updates an unedited name. */
export function withVehicle(form: CampaignForm, catalogue: Catalogue, kind: string): CampaignForm {
  return renamed(form, { ...form, registered: null, vehicle: { kind, options: {} } }, catalogue);
}

/** Select a registered vehicle: changes the experiment if the vehicle does not fly it. */
export function withRegistered(form: CampaignForm, catalogue: Catalogue, registered: Vehicle): CampaignForm {
  const { experiment } = form.definition;
  const { kind, experiments } = registered;
  const suited = fits(experiments, experiment) ? form : withExperiment(form, catalogue, experiments[0] ?? experiment);
  return renamed(form, { ...suited, registered, vehicle: { kind, options: {} } }, catalogue);
}

/** Select an experiment: resets everything except a vehicle that flies it, the stop rule, the seed and an edited name. */
export function withExperiment(form: CampaignForm, catalogue: Catalogue, experiment: string): CampaignForm {
  const { stop, seed } = form.definition;
  const fresh = startingForm(catalogue, experiment);
  const { registered, vehicle } = flies(form, catalogue, experiment) ? form : fresh;
  const definition = { ...fresh.definition, stop: { ...stop, min_battery_v: "" }, seed };
  return renamed(form, { ...fresh, registered, vehicle, definition }, catalogue);
}

/** Whether the form's vehicle flies this experiment itself. */
function flies({ vehicle, registered }: CampaignForm, catalogue: Catalogue, experiment: string): boolean {
  return registered === null
    ? kindsFor(catalogue, experiment).some(({ name, can_fly }) => can_fly && name === vehicle.kind)
    : fits(registered.experiments, experiment);
}

/** Bounds that differ from those of the experiment. */
function narrowed({ definition }: CampaignForm, catalogue: Catalogue): Record<string, [number, number]> {
  const bounds: Record<string, [number, number]> = {};
  for (const { name, lower, upper } of gainsOf(catalogue, definition.experiment)) {
    const [low, high] = definition.bounds[name] ?? [];
    const pair: [number, number] = [typeof low === "number" ? low : lower, typeof high === "number" ? high : upper];
    if (pair[0] !== lower || pair[1] !== upper) bounds[name] = pair;
  }
  return bounds;
}

function startFrom({ kind, gains, donor }: CampaignForm["definition"]["start"]) {
  if (kind === "given") return { kind, gains: numbersOf(gains) };
  if (kind === "campaign") return { kind, donor: donor === null ? null : { campaign_id: donor.id } };
  return { kind };
}

/** The request; an empty number field is left to the server's default. */
export function requestFrom(form: CampaignForm, catalogue: Catalogue): NewCampaign {
  const { name, registered, vehicle, definition } = form;
  const { experiment, experiment_options, strategy, options, start, stop, bounds: _, ...numbers } = definition;
  const { kind, ...limits } = stop;
  return {
    name,
    vehicle: registered === null ? vehicle : { kind: registered.kind, id: registered.id },
    definition: {
      experiment,
      experiment_options,
      strategy,
      options,
      start: startFrom(start),
      bounds: narrowed(form, catalogue),
      ...numbersOf(numbers),
      stop: { kind, ...numbersOf(limits) },
    },
  };
}
