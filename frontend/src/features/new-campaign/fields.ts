/** Fields of a new campaign: which ones the form shows, and what they are called. Their paths are those of the request. */

import type { Catalogue, Gain, OptionInfo } from "../../api/types";
import type { NumberEntry, NumberFieldProps } from "../../ui/Fields";
import { experimentOf, unitsOf } from "../../ui/units";
import { type CampaignForm, gainsOf } from "./newCampaign";

export interface NumberInfo {
  path: string;
  label: string;
  isShare?: true;
  input?: Pick<NumberFieldProps, "description" | "placeholder" | "rightSection" | "whole">;
  /** Where the field is shown; everywhere without it. */
  isShown?: (form: CampaignForm, catalogue: Catalogue) => boolean;
}

/** Whether the experiment controls an altitude. */
function isAltitude({ definition }: CampaignForm, catalogue: Catalogue): boolean {
  return unitsOf(catalogue, definition.experiment).output === "m";
}

/** Whether flights of the form's vehicle are simulated by the server itself, and depend on the seed. */
function isSeeded({ vehicle }: CampaignForm, catalogue: Catalogue): boolean {
  return catalogue.vehicle_kinds.some(
    ({ name, can_fly, registered }) => name === vehicle.kind && can_fly && !registered,
  );
}

const NUMBERS: Readonly<Record<"stop" | "steps" | "seed", readonly NumberInfo[]>> = {
  stop: [
    { path: "definition.stop.max_flights", label: "Maximum flights", input: { whole: true } },
    {
      path: "definition.stop.improvement",
      label: "Improvement threshold",
      isShare: true,
      isShown: ({ definition }) => definition.stop.kind === "paper",
    },
    {
      path: "definition.stop.confidence",
      label: "Confidence",
      isShare: true,
      isShown: ({ definition }) => definition.stop.kind === "noise",
    },
    {
      path: "definition.stop.min_battery_v",
      label: "Minimum battery voltage",
      input: { placeholder: "No limit", rightSection: "V" },
      isShown: isAltitude,
    },
  ],
  steps: [
    {
      path: "definition.first_step_fraction",
      label: "Maximum first step",
      isShare: true,
      input: { description: "Fraction of each gain's range, until the first valid flight" },
    },
    {
      path: "definition.step_fraction",
      label: "Maximum later step",
      isShare: true,
      input: { description: "Fraction of each gain's range, after that" },
    },
    {
      path: "definition.ceiling_m",
      label: "Gate ceiling",
      input: {
        description: "Gains that could take the vehicle above this altitude are refused",
        rightSection: "m",
      },
      isShown: (form, catalogue) =>
        isAltitude(form, catalogue) && experimentOf(catalogue, form.definition.experiment)?.has_model === true,
    },
  ],
  seed: [
    {
      path: "definition.seed",
      label: "Seed",
      input: { description: "The same seed reproduces the same scatter", whole: true },
      isShown: isSeeded,
    },
  ],
};

/** The advanced number fields that this form shows, by their groups. */
export function numbersFor(form: CampaignForm, catalogue: Catalogue) {
  const shown = (group: keyof typeof NUMBERS): NumberInfo[] =>
    NUMBERS[group].filter(({ isShown }) => isShown?.(form, catalogue) ?? true);
  return { stop: shown("stop"), steps: shown("steps"), seed: shown("seed") };
}

export interface OptionGroup {
  path: string;
  title: string;
  options: readonly OptionInfo[];
}

/** Options of the selected strategy, experiment and vehicle; the height is at most what the vehicle is commanded to. */
export function optionsFor({ definition, vehicle, registered }: CampaignForm, catalogue: Catalogue) {
  const strategy = catalogue.strategies.find(({ name }) => name === definition.strategy);
  const experiment = experimentOf(catalogue, definition.experiment);
  const kind = catalogue.vehicle_kinds.find(({ name }) => name === vehicle.kind);
  const group = (word: string, path: string, of: Pick<OptionGroup, "title" | "options"> | undefined): OptionGroup => ({
    path,
    title: `${word}: ${of?.title ?? ""}`,
    options: of?.options ?? [],
  });
  const limited = (option: OptionInfo): OptionInfo =>
    option.name === "height_m" ? { ...option, upper: kind?.highest_set_point_m ?? option.upper } : option;
  return {
    strategy: group("Strategy", "definition.options", strategy),
    experiment: group(
      "Experiment",
      "definition.experiment_options",
      experiment && { ...experiment, options: experiment.options.map(limited) },
    ),
    vehicle: group("Vehicle", "vehicle.options", registered === null ? kind : undefined),
  };
}

/** Title of the advanced settings: what is among them for this experiment and vehicle. */
export function advancedTitle(form: CampaignForm, catalogue: Catalogue): string {
  const hasWindow = optionsFor(form, catalogue).experiment.options.some(({ name }) => name === "window_s");
  const parts = ["stop rule", hasWindow && "window", "bounds", isSeeded(form, catalogue) && "seed"];
  return `Advanced: ${parts.filter(Boolean).join(", ")}`;
}

type Labels = Record<string, string>;

/** Labels of the form's fields: always visible ones and advanced ones. */
export function fieldsOf(form: CampaignForm, catalogue: Catalogue): { plain: Labels; advanced: Labels } {
  const { start, experiment } = form.definition;
  const gains = gainsOf(catalogue, experiment).map(({ name }) => name);
  const numbers = Object.values(numbersFor(form, catalogue)).flat();
  const options = optionsFor(form, catalogue);
  const titled = ({ path, options }: OptionGroup): Labels =>
    Object.fromEntries(options.map(({ name, title }) => [`${path}.${name}`, title]));
  const given = gains.map((name) => [`definition.start.gains.${name}`, name]);
  return {
    plain: {
      name: "Name",
      "definition.experiment": "Experiment",
      "vehicle.kind": "Vehicle",
      "vehicle.id": "Vehicle",
      "definition.strategy": "Strategy",
      "definition.start.kind": "Start from",
      ...(start.kind === "given" ? Object.fromEntries(given) : {}),
      ...(start.kind === "campaign" ? { "definition.start.donor": "Campaign" } : {}),
    },
    advanced: {
      ...Object.fromEntries(numbers.map(({ path, label }) => [path, label])),
      ...titled(options.strategy),
      ...titled(options.experiment),
      ...Object.fromEntries(gains.map((name) => [`definition.bounds.${name}`, `bounds of ${name}`])),
      ...titled(options.vehicle),
    },
  };
}

/** A reason about a gain's bounds, at the bounds that are wrong: both, where each is right by itself. */
export function boundReasons<Reason>(
  { lower, upper, integer }: Pick<Gain, "lower" | "upper" | "integer">,
  [low, high]: readonly [NumberEntry, NumberEntry],
  reason: Reason,
): [minimum: Reason | undefined, maximum: Reason | undefined] {
  const isWrong = (bound: NumberEntry): boolean =>
    typeof bound === "number" && (bound < lower || bound > upper || (integer && !Number.isInteger(bound)));
  const wrong = [isWrong(low), isWrong(high)] as const;
  const both = !wrong[0] && !wrong[1];
  return [wrong[0] || both ? reason : undefined, wrong[1] || both ? reason : undefined];
}

/** Labels of fields without a valid number; the campaign cannot be created until they are corrected. */
export function unreadable(form: CampaignForm, read: (path: string) => unknown, catalogue: Catalogue): string[] {
  const { start, experiment } = form.definition;
  const gains = gainsOf(catalogue, experiment).map(({ name }) => name);
  const numbers: { path: string; label: string }[] = [
    ...Object.values(numbersFor(form, catalogue)).flat(),
    ...gains.flatMap((name) => [
      { path: `definition.bounds.${name}.0`, label: `${name} minimum` },
      { path: `definition.bounds.${name}.1`, label: `${name} maximum` },
    ]),
    ...Object.values(optionsFor(form, catalogue)).flatMap(({ path, options }) =>
      options
        .filter((option) => typeof option.default === "number")
        .map(({ name, title }) => ({ path: `${path}.${name}`, label: title })),
    ),
  ];
  const isText = (entry: unknown): boolean => typeof entry === "string" && entry.trim() !== "";
  return [
    ...(start.kind === "given" ? gains.filter((name) => typeof start.gains[name] !== "number") : []),
    ...numbers.filter(({ path }) => isText(read(path))).map(({ label }) => label),
  ];
}
