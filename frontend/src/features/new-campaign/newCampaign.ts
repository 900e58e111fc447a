/** Form of a new campaign: its defaults and its request. Number fields contain text until it is a valid number. */

import { inPercent } from "../../api/problems";
import type {
  CampaignSummary,
  Catalogue,
  Gain,
  NewCampaign,
  OptionInfo,
  PresetInfo,
  Vehicle,
  VehicleKindInfo,
} from "../../api/types";
import type { NumberEntry, OptionValue } from "../../ui/Fields";

export type StartKind = "default" | "simplex" | "given" | "campaign";
export type StopKind = "noise" | "paper" | "budget";

/** The fields of a registered vehicle that the form needs. */
export type Chosen = Pick<Vehicle, "id" | "kind" | "name" | "experiments">;

export interface CampaignForm {
  name: string;
  experiment: string;
  experimentOptions: Record<string, OptionValue>;
  vehicle: string;
  registered: Chosen | null;
  vehicleOptions: Record<string, OptionValue>;
  strategy: string;
  strategyOptions: Record<string, OptionValue>;
  start: StartKind;
  startGains: Record<string, NumberEntry>;
  donor: CampaignSummary | null;
  stop: StopKind;
  maxFlights: NumberEntry;
  improvementPercent: NumberEntry;
  confidencePercent: NumberEntry;
  minBatteryV: NumberEntry;
  bounds: Record<string, [NumberEntry, NumberEntry]>;
  firstStepPercent: NumberEntry;
  stepPercent: NumberEntry;
  ceilingM: NumberEntry;
  seed: NumberEntry;
}

export function gainsOf(catalogue: Catalogue, experiment: string) {
  return catalogue.experiments.find(({ name }) => name === experiment)?.gains ?? [];
}

/** Whether the experiment has a model; without one, gains are chosen manually and nothing is simulated. */
export function hasModel(catalogue: Catalogue, experiment: string): boolean {
  return catalogue.experiments.find(({ name }) => name === experiment)?.has_model ?? false;
}

/** Available sources of the first gains: a search on the model only where it is a strategy too. */
export function startsFor(catalogue: Catalogue, experiment: string): StartKind[] {
  return strategiesFor(catalogue, experiment).some(({ name }) => name === "simplex")
    ? ["default", "simplex", "campaign", "given"]
    : ["default", "campaign", "given"];
}

/** Whether `experiments` includes this one; an empty list means all. */
function fits(experiments: readonly string[] | undefined, experiment: string): boolean {
  return experiments === undefined || experiments.length === 0 || experiments.includes(experiment);
}

/** Shared vehicles of this experiment: simulations first, vehicles flown elsewhere last. */
export function kindsFor(catalogue: Catalogue, experiment: string): VehicleKindInfo[] {
  const rank = (kind: VehicleKindInfo): number => (kind.name === "jsbsim" ? 0 : kind.can_fly ? 1 : 2);
  const kinds: readonly VehicleKindInfo[] = catalogue.vehicle_kinds;
  const shared = kinds.filter((kind) => !kind.registered && fits(kind.experiments, experiment));
  return shared.sort((one, other) => rank(one) - rank(other));
}

/** Registered vehicles that fly this experiment. */
export function registeredFor<T extends Vehicle>(vehicles: readonly T[], experiment: string): T[] {
  return vehicles.filter(({ registered, experiments }) => registered && fits(experiments, experiment));
}

/** Registered vehicles that fly another one. */
export function flyingOther<T extends Vehicle>(vehicles: readonly T[], experiment: string): T[] {
  return vehicles.filter(({ registered, experiments }) => registered && !fits(experiments, experiment));
}

/** Strategies of this experiment in the catalogue's order; the first is recommended. */
export function strategiesFor(catalogue: Catalogue, experiment: string) {
  return catalogue.strategies.filter((strategy) => fits(strategy.experiments, experiment));
}

function presetFor(catalogue: Catalogue, experiment: string, vehicle: string): PresetInfo | undefined {
  return catalogue.presets.find(
    ({ campaign }) =>
      campaign.vehicle?.kind === vehicle && (campaign.definition?.experiment ?? "takeoff") === experiment,
  );
}

function nameFor(catalogue: Catalogue, experiment: string, vehicle: string): string {
  const title = catalogue.experiments.find(({ name }) => name === experiment)?.title ?? experiment;
  if (vehicle === "") return title;
  const kind = catalogue.vehicle_kinds.find(({ name }) => name === vehicle);
  const by = kind === undefined ? vehicle : kind.can_fly ? kind.title : kind.title.toLowerCase();
  return presetFor(catalogue, experiment, vehicle)?.title ?? `${title}, ${by}`;
}

/** Whether flights of the form's vehicle are simulated by the server itself, and depend on the seed. */
export function isSeeded({ vehicle }: CampaignForm, catalogue: Catalogue): boolean {
  return catalogue.vehicle_kinds.some(({ name, can_fly, registered }) => name === vehicle && can_fly && !registered);
}

/** Title of the advanced settings: what is among them for this experiment and vehicle. */
export function advancedTitle(form: CampaignForm, catalogue: Catalogue): string {
  const hasWindow = optionsOf(form, catalogue).experiment.some(({ name }) => name === "window_s");
  const parts = ["stop rule", hasWindow && "window", "bounds", isSeeded(form, catalogue) && "seed"];
  return `Advanced: ${parts.filter(Boolean).join(", ")}`;
}

/** The preset that one click creates: the simulated takeoff. */
export function firstPreset(catalogue: Catalogue): PresetInfo | undefined {
  return catalogue.presets.find(({ campaign }) => campaign.vehicle?.kind === "jsbsim") ?? catalogue.presets[0];
}

export function startingForm(
  catalogue: Catalogue,
  experiment: string = catalogue.experiments[0]?.name ?? "takeoff",
): CampaignForm {
  const vehicle = kindsFor(catalogue, experiment)[0]?.name ?? "";
  const gains = gainsOf(catalogue, experiment);
  return {
    name: nameFor(catalogue, experiment, vehicle),
    experiment,
    experimentOptions: {},
    vehicle,
    registered: null,
    vehicleOptions: {},
    strategy: strategiesFor(catalogue, experiment)[0]?.name ?? "gradient",
    strategyOptions: {},
    start: "default",
    startGains: Object.fromEntries(gains.map((gain) => [gain.name, gain.default])),
    donor: null,
    stop: "noise",
    maxFlights: 7,
    improvementPercent: 5,
    confidencePercent: 90,
    minBatteryV: "",
    bounds: Object.fromEntries(gains.map((gain) => [gain.name, [gain.lower, gain.upper]])),
    firstStepPercent: 25,
    stepPercent: hasModel(catalogue, experiment) ? 100 : 25,
    ceilingM: 4.5,
    seed: 1,
  };
}

function isNamedByHand({ name, experiment, vehicle, registered }: CampaignForm, catalogue: Catalogue): boolean {
  const isTitle = catalogue.presets.some(({ title }) => title === name);
  return !isTitle && name !== nameFor(catalogue, experiment, registered?.name ?? vehicle);
}

function percentOf(share: number): number {
  return Number((100 * share).toPrecision(12));
}

/** Select a preset: replaces everything except an edited name. */
export function withPreset(form: CampaignForm, catalogue: Catalogue, { title, campaign }: PresetInfo): CampaignForm {
  const { definition, vehicle } = campaign;
  const fresh = startingForm(catalogue, definition.experiment);
  return {
    ...fresh,
    name: isNamedByHand(form, catalogue) ? form.name : title,
    experimentOptions: definition.experiment_options,
    vehicle: vehicle.kind,
    vehicleOptions: vehicle.options,
    strategy: definition.strategy,
    strategyOptions: definition.options,
    start: definition.start.kind,
    startGains: { ...fresh.startGains, ...definition.start.gains },
    stop: definition.stop.kind,
    maxFlights: definition.stop.max_flights,
    improvementPercent: percentOf(definition.stop.improvement),
    confidencePercent: percentOf(definition.stop.confidence),
    minBatteryV: definition.stop.min_battery_v ?? "",
    bounds: { ...fresh.bounds, ...definition.bounds },
    firstStepPercent: percentOf(definition.first_step_fraction),
    stepPercent: percentOf(definition.step_fraction),
    ceilingM: definition.ceiling_m,
    seed: definition.seed,
  };
}

/** The preset whose settings the form has; undefined if they are others. */
export function presetOf(form: CampaignForm, catalogue: Catalogue): PresetInfo | undefined {
  const settings = (one: CampaignForm): string => JSON.stringify({ ...one, name: "" });
  return catalogue.presets.find((preset) => settings(withPreset(form, catalogue, preset)) === settings(form));
}

/** Select a vehicle: resets the vehicle settings and updates an unedited name. */
export function withVehicle(form: CampaignForm, catalogue: Catalogue, vehicle: string): CampaignForm {
  const name = isNamedByHand(form, catalogue) ? form.name : nameFor(catalogue, form.experiment, vehicle);
  return { ...form, vehicle, registered: null, vehicleOptions: {}, name };
}

/** Select a registered vehicle: changes the experiment if the vehicle does not fly it. */
export function withRegistered(form: CampaignForm, catalogue: Catalogue, registered: Chosen): CampaignForm {
  const own = registered.experiments[0] ?? form.experiment;
  const suited = fits(registered.experiments, form.experiment) ? form : withExperiment(form, catalogue, own);
  const name = isNamedByHand(suited, catalogue) ? suited.name : nameFor(catalogue, suited.experiment, registered.name);
  return { ...suited, vehicle: registered.kind, registered, vehicleOptions: {}, name };
}

/** Select an experiment: resets everything except a vehicle that flies it, the stop rule, the seed and an edited name. */
export function withExperiment(form: CampaignForm, catalogue: Catalogue, experiment: string): CampaignForm {
  const { stop, maxFlights, improvementPercent, confidencePercent, seed } = form;
  const fresh = startingForm(catalogue, experiment);
  const { vehicle, registered, vehicleOptions } = flies(form, catalogue, experiment) ? form : fresh;
  const name = isNamedByHand(form, catalogue) ? form.name : nameFor(catalogue, experiment, registered?.name ?? vehicle);
  return {
    ...fresh,
    name,
    vehicle,
    registered,
    vehicleOptions,
    stop,
    maxFlights,
    improvementPercent,
    confidencePercent,
    seed,
  };
}

/** Whether the form's vehicle flies this experiment itself. */
function flies({ vehicle, registered }: CampaignForm, catalogue: Catalogue, experiment: string): boolean {
  return registered === null
    ? kindsFor(catalogue, experiment).some(({ name, can_fly }) => can_fly && name === vehicle)
    : fits(registered.experiments, experiment);
}

function number(entry: NumberEntry, fallback: number): number {
  return typeof entry === "number" ? entry : fallback;
}

function share(entry: NumberEntry, fallback: number): number {
  return typeof entry === "number" ? Number((entry / 100).toPrecision(12)) : fallback;
}

/** Bounds that differ from those of the experiment. */
function narrowed(form: CampaignForm, catalogue: Catalogue): Record<string, [number, number]> {
  const bounds: Record<string, [number, number]> = {};
  for (const gain of gainsOf(catalogue, form.experiment)) {
    const [low, high] = form.bounds[gain.name] ?? [gain.lower, gain.upper];
    const pair: [number, number] = [number(low, gain.lower), number(high, gain.upper)];
    if (pair[0] !== gain.lower || pair[1] !== gain.upper) bounds[gain.name] = pair;
  }
  return bounds;
}

type Definition = NonNullable<NewCampaign["definition"]>;

function startFrom({ start, startGains, donor }: CampaignForm): NonNullable<Definition["start"]> {
  if (start === "given") {
    const gains = Object.entries(startGains).flatMap(([name, entry]) =>
      typeof entry === "number" ? [[name, entry]] : [],
    );
    return { kind: start, gains: Object.fromEntries(gains) };
  }
  if (start === "campaign") return { kind: start, donor: donor === null ? null : { campaign_id: donor.id } };
  return { kind: start };
}

function stopFrom(form: CampaignForm): NonNullable<Definition["stop"]> {
  return {
    kind: form.stop,
    max_flights: number(form.maxFlights, 7),
    improvement: share(form.improvementPercent, 0.05),
    confidence: share(form.confidencePercent, 0.9),
    min_battery_v: typeof form.minBatteryV === "number" ? form.minBatteryV : null,
  };
}

export function requestFrom(form: CampaignForm, catalogue: Catalogue): NewCampaign {
  return {
    name: form.name,
    vehicle: form.registered
      ? { kind: form.registered.kind, id: form.registered.id }
      : { kind: form.vehicle, options: form.vehicleOptions },
    definition: {
      experiment: form.experiment,
      experiment_options: form.experimentOptions,
      strategy: form.strategy,
      options: form.strategyOptions,
      start: startFrom(form),
      bounds: narrowed(form, catalogue),
      first_step_fraction: share(form.firstStepPercent, 0.25),
      step_fraction: share(form.stepPercent, 1),
      ceiling_m: number(form.ceilingM, 4.5),
      stop: stopFrom(form),
      seed: number(form.seed, 1),
    },
  };
}

export interface OffersOptions {
  experiment: readonly OptionInfo[];
  strategy: readonly OptionInfo[];
  vehicle: readonly OptionInfo[];
}

/** Options of the selected experiment, strategy and vehicle; the height is at most what the vehicle is commanded to. */
export function optionsOf(form: CampaignForm, catalogue: Catalogue): OffersOptions {
  const kind = catalogue.vehicle_kinds.find(({ name }) => name === form.vehicle);
  const experiment = catalogue.experiments.find(({ name }) => name === form.experiment)?.options ?? [];
  return {
    experiment: experiment.map((option) =>
      option.name === "height_m" ? { ...option, upper: kind?.highest_set_point_m ?? option.upper } : option,
    ),
    strategy: catalogue.strategies.find(({ name }) => name === form.strategy)?.options ?? [],
    vehicle: form.registered ? [] : (kind?.options ?? []),
  };
}

/** Labels by the server's names of the fields. */
export const LABELS = {
  name: "Name",
  "definition.experiment": "Experiment",
  "vehicle.kind": "Vehicle",
  "vehicle.id": "Vehicle",
  strategy: "Strategy",
  "start.kind": "Start from",
} as const;

export const ADVANCED_LABELS = {
  "stop.max_flights": "Maximum flights",
  "stop.improvement": "Improvement threshold",
  "stop.confidence": "Confidence",
  "stop.min_battery_v": "Minimum battery voltage",
  first_step_fraction: "Maximum first step",
  step_fraction: "Maximum later step",
  ceiling_m: "Gate ceiling",
  seed: "Seed",
} as const;

type Labels = Record<string, string>;

function labelled(names: readonly string[], prefix: string, title = ""): Labels {
  return Object.fromEntries(names.map((name) => [`${prefix}.${name}`, `${title}${name}`]));
}

/** Labels of the form's fields by their server names: always visible ones and advanced ones. */
export function fieldsOf(form: CampaignForm, catalogue: Catalogue): { plain: Labels; advanced: Labels } {
  const gains = gainsOf(catalogue, form.experiment).map(({ name }) => name);
  const options = optionsOf(form, catalogue);
  const titled = (offered: readonly OptionInfo[], prefix: string): Labels =>
    Object.fromEntries(offered.map(({ name, title }) => [`${prefix}.${name}`, title]));
  return {
    plain: {
      ...LABELS,
      ...(form.start === "given" ? labelled(gains, "start.gains") : {}),
      ...(form.start === "campaign" ? { "start.donor": "Campaign" } : {}),
    },
    advanced: {
      ...ADVANCED_LABELS,
      ...titled(options.strategy, "definition.options"),
      ...titled(options.experiment, "experiment_options"),
      ...labelled(gains, "bounds", "bounds of "),
      ...titled(options.vehicle, "vehicle.options"),
    },
  };
}

const SHARES = ["stop.improvement", "stop.confidence", "first_step_fraction", "step_fraction"] as const;

/** Reasons by field, those about shares in percent, as the form shows them. */
export function inUnitsOfForm(reasons: Readonly<Record<string, string>>): Record<string, string> {
  const shares = SHARES.flatMap((field) => (reasons[field] === undefined ? [] : [[field, inPercent(reasons[field])]]));
  return { ...reasons, ...Object.fromEntries(shares) };
}

/** A reason about a gain's bounds, at the bounds that are wrong: both, where each is right by itself. */
export function boundReasons(
  { lower, upper, integer }: Pick<Gain, "lower" | "upper" | "integer">,
  [low, high]: readonly [NumberEntry, NumberEntry],
  reason: string | undefined,
): [minimum: string | undefined, maximum: string | undefined] {
  const isWrong = (bound: NumberEntry): boolean =>
    typeof bound === "number" && (bound < lower || bound > upper || (integer && !Number.isInteger(bound)));
  const wrong = [isWrong(low), isWrong(high)] as const;
  const both = !wrong[0] && !wrong[1];
  return [wrong[0] || both ? reason : undefined, wrong[1] || both ? reason : undefined];
}

/** Labels of fields without a valid number; the campaign cannot be created until they are corrected. */
export function unreadable(form: CampaignForm, catalogue: Catalogue): string[] {
  const isText = (entry: NumberEntry): boolean => typeof entry === "string" && entry.trim() !== "";
  const gains = gainsOf(catalogue, form.experiment).map(({ name }) => name);
  const options = optionsOf(form, catalogue);
  const typedOptions = (offered: readonly OptionInfo[], chosen: Record<string, OptionValue>): string[] =>
    offered
      .filter(({ name, default: standard }) => typeof standard === "number" && typeof chosen[name] === "string")
      .map(({ title }) => title);
  const entries: [string, NumberEntry][] = [
    [ADVANCED_LABELS["stop.max_flights"], form.maxFlights],
    [ADVANCED_LABELS["stop.improvement"], form.stop === "paper" ? form.improvementPercent : ""],
    [ADVANCED_LABELS["stop.confidence"], form.stop === "noise" ? form.confidencePercent : ""],
    [ADVANCED_LABELS["stop.min_battery_v"], form.minBatteryV],
    [ADVANCED_LABELS.first_step_fraction, form.firstStepPercent],
    [ADVANCED_LABELS.step_fraction, form.stepPercent],
    [ADVANCED_LABELS.ceiling_m, form.ceilingM],
    [ADVANCED_LABELS.seed, form.seed],
    ...gains.flatMap((name): [string, NumberEntry][] => [
      [`${name} minimum`, form.bounds[name]?.[0] ?? ""],
      [`${name} maximum`, form.bounds[name]?.[1] ?? ""],
    ]),
  ];
  return [
    ...(form.start === "given" ? gains.filter((name) => typeof form.startGains[name] !== "number") : []),
    ...entries.filter(([, entry]) => isText(entry)).map(([title]) => title),
    ...typedOptions(options.strategy, form.strategyOptions),
    ...typedOptions(options.experiment, form.experimentOptions),
    ...typedOptions(options.vehicle, form.vehicleOptions),
  ];
}
