import { expect, test } from "vitest";
import type { CampaignSummary, Catalogue, Vehicle } from "../../api/types";
import { advancedTitle, boundReasons, fieldsOf, optionsFor } from "./fields";
import {
  type CampaignForm,
  firstPreset,
  kindsFor,
  presetOf,
  registeredFor,
  requestFrom,
  startingForm,
  startsFor,
  strategiesFor,
  withExperiment,
  withPreset,
  withRegistered,
  withVehicle,
} from "./newCampaign";

const gain = (name: string, upper: number, value: number) => ({
  name,
  title: name,
  unit: "counts",
  lower: 0,
  upper,
  scale: upper / 10,
  default: value,
  integer: true,
});

const catalogue = {
  experiments: [
    {
      name: "takeoff",
      title: "Takeoff to 3 m",
      has_model: true,
      gains: [gain("kp", 4000, 283), gain("ki", 1073, 13), gain("kd", 409, 82)],
      options: [],
    },
    {
      name: "takeoff-px4",
      title: "Takeoff under PX4",
      has_model: false,
      gains: [gain("MPC_Z_P", 1.5, 1)],
      options: [],
    },
    {
      name: "pitch-tracking",
      title: "Pitch tracking",
      has_model: true,
      gains: [gain("theta_3", 0, -15)],
      options: [{ name: "perturbation", title: "Model off by", default: 0.45, choices: [] }],
    },
  ],
  strategies: [
    { name: "calibrated", options: [], experiments: ["takeoff"] },
    {
      name: "gradient",
      options: [{ name: "scaled", title: "Scaled", default: true, choices: [true, false] }],
      experiments: ["takeoff", "pitch-tracking"],
    },
    { name: "identified", options: [], experiments: ["pitch-tracking"] },
    { name: "simplex", options: [], experiments: ["takeoff", "pitch-tracking"] },
    { name: "manual", options: [], experiments: ["takeoff", "takeoff-px4", "pitch-tracking"] },
  ],
  vehicle_kinds: [
    { name: "import", title: "Flown elsewhere", can_fly: false, options: [], experiments: ["takeoff", "takeoff-px4"] },
    { name: "lti", title: "F-16", can_fly: true, options: [], experiments: ["pitch-tracking"] },
    { name: "twin", can_fly: true, options: [], experiments: ["takeoff"] },
    { name: "jsbsim", can_fly: true, options: [{ name: "mass_kg" }], experiments: ["takeoff"] },
  ],
  presets: [
    {
      name: "twin",
      title: "Twin takeoff",
      campaign: { vehicle: { kind: "twin" }, definition: { experiment: "takeoff" } },
    },
    {
      name: "ardrone",
      title: "Simulated takeoff",
      campaign: { vehicle: { kind: "jsbsim" }, definition: { experiment: "takeoff" } },
    },
  ],
} as unknown as Catalogue;

const bee = { id: 7, kind: "mavlink", name: "Bee", registered: true, experiments: ["takeoff"] } as Vehicle;
const wasp = { ...bee, id: 8, name: "Wasp", experiments: ["takeoff-px4"] };
const shared = { ...bee, id: 1, kind: "twin", registered: false };

const start = startingForm(catalogue);
const defined = (change: object): CampaignForm => ({ ...start, definition: { ...start.definition, ...change } });
const stopping = (change: object): CampaignForm => defined({ stop: { ...start.definition.stop, ...change } });
const names = (things: readonly { name: string }[]): string[] => things.map(({ name }) => name);

test("the form as it comes creates the recommended campaign on the simulation", () => {
  expect(requestFrom(start, catalogue)).toEqual({
    name: "Simulated takeoff",
    vehicle: { kind: "jsbsim", options: {} },
    definition: {
      experiment: "takeoff",
      experiment_options: {},
      strategy: "calibrated",
      options: {},
      start: { kind: "default" },
      bounds: {},
      first_step_fraction: 0.25,
      step_fraction: 1,
      ceiling_m: 4.5,
      stop: { kind: "noise", max_flights: 7, improvement: 0.05, confidence: 0.9 },
      seed: 1,
    },
  });
});

test("bounds are sent only where they are tighter", () => {
  const form = defined({ bounds: { kp: [0, 2000], ki: [0, 1073], kd: ["", 409] } });
  expect(requestFrom(form, catalogue).definition?.bounds).toEqual({ kp: [0, 2000] });
});

test("a wrong number is sent as it is, for the server to refuse, and an empty field has the server's default", () => {
  const form = stopping({ max_flights: -3, improvement: "", min_battery_v: 10.8 });
  expect(requestFrom(form, catalogue).definition?.stop).toEqual({
    kind: "noise",
    max_flights: -3,
    confidence: 0.9,
    min_battery_v: 10.8,
  });
});

test("a name of flights flown elsewhere is a sentence, and the advanced settings are named after what is there", () => {
  const window = { name: "window_s", title: "Scored window", default: 32.6, choices: [] };
  const offering = {
    ...catalogue,
    experiments: catalogue.experiments.map((one) => ({ ...one, options: one.name === "takeoff" ? [window] : [] })),
  } as unknown as Catalogue;
  expect(advancedTitle(start, offering)).toBe("Advanced: stop rule, window, bounds, seed");
  expect(advancedTitle(withVehicle(start, offering, "import"), offering)).toBe("Advanced: stop rule, window, bounds");
  const f16 = withExperiment(start, offering, "pitch-tracking");
  expect(advancedTitle(f16, offering)).toBe("Advanced: stop rule, bounds, seed");
  expect(withExperiment(start, offering, "takeoff-px4").name).toBe("Takeoff under PX4, flown elsewhere");
});

test("a name follows the vehicle until somebody has changed it", () => {
  const heavy = { ...start, name: "Mine", vehicle: { kind: "jsbsim", options: { mass_kg: 0.5 } } };
  expect(withVehicle(start, catalogue, "twin").name).toBe("Twin takeoff");
  expect(withVehicle(heavy, catalogue, "twin")).toMatchObject({ name: "Mine", vehicle: { kind: "twin", options: {} } });
});

test("a warm start names the other campaign, and nothing until one is chosen", () => {
  const sent = (donor: CampaignSummary | null) =>
    requestFrom(defined({ start: { kind: "campaign", gains: {}, donor } }), catalogue).definition?.start;
  expect(sent(null)).toEqual({ kind: "campaign", donor: null });
  expect(sent({ id: 12, name: "Yesterday's" } as CampaignSummary)).toEqual({
    kind: "campaign",
    donor: { campaign_id: 12 },
  });
});

test("an experiment is offered the vehicles and strategies that fit it, the simulation first", () => {
  expect(names(kindsFor(catalogue, "takeoff"))).toEqual(["jsbsim", "twin", "import"]);
  expect(firstPreset(catalogue)?.name).toBe("ardrone");
  expect(names(kindsFor(catalogue, "pitch-tracking"))).toEqual(["lti"]);
  expect(names(strategiesFor(catalogue, "takeoff"))).toEqual(["calibrated", "gradient", "simplex", "manual"]);
  expect(names(strategiesFor(catalogue, "pitch-tracking"))).toEqual(["gradient", "identified", "simplex", "manual"]);
});

test("another experiment begins with its own gains, vehicle and strategy, and keeps the stop rule", () => {
  const form = withExperiment(stopping({ max_flights: 25 }), catalogue, "pitch-tracking");
  expect(form).toMatchObject({
    name: "Pitch tracking, F-16",
    vehicle: { kind: "lti" },
    definition: {
      experiment: "pitch-tracking",
      strategy: "gradient",
      start: { gains: { theta_3: -15 } },
      stop: { max_flights: 25 },
    },
  });
  expect(requestFrom(form, catalogue).definition?.bounds).toEqual({});
});

test("every refusable field has its place in the form", () => {
  const fields = (form: CampaignForm) => fieldsOf(form, catalogue);
  const gradient = fields(defined({ strategy: "gradient" }));
  expect(Object.keys(gradient.plain)).not.toContain("definition.start.gains.kp");
  expect(Object.keys(gradient.advanced)).toEqual(
    expect.arrayContaining([
      "definition.stop.max_flights",
      "definition.bounds.kd",
      "vehicle.options.mass_kg",
      "definition.options.scaled",
    ]),
  );
  const given = fields(defined({ start: { kind: "given", gains: {}, donor: null } }));
  expect(Object.keys(given.plain)).toContain("definition.start.gains.kp");
});

test("without a model gains are chosen by hand, in small steps, and no start is searched", () => {
  expect(withExperiment(start, catalogue, "takeoff-px4")).toMatchObject({
    vehicle: { kind: "import" },
    definition: { strategy: "manual", first_step_fraction: 0.25, step_fraction: 0.25 },
  });
  expect(startsFor(catalogue, "takeoff-px4")).toEqual(["default", "campaign", "given"]);
  expect(startsFor(catalogue, "takeoff")).toContain("simplex");
});

test("registered vehicles are offered where they have the experiment's gains, shared ones by their kinds alone", () => {
  expect(registeredFor([shared, bee, wasp], "takeoff")).toEqual([bee]);
});

test("a registered vehicle is asked for by its id, with the settings that stand at it", () => {
  const form = withRegistered({ ...start, vehicle: { kind: "jsbsim", options: { mass_kg: 0.5 } } }, catalogue, bee);
  expect(requestFrom(form, catalogue)).toMatchObject({ name: "Takeoff to 3 m, Bee" });
  expect(requestFrom(form, catalogue).vehicle).toEqual({ kind: "mavlink", id: 7 });
  expect(optionsFor(form, catalogue).vehicle.options).toEqual([]);
  expect(requestFrom(withVehicle(form, catalogue, "twin"), catalogue)).toMatchObject({
    name: "Twin takeoff",
    vehicle: { kind: "twin", options: {} },
  });
});

test("a vehicle that flies another experiment brings it along, with its gains; a name of one's own stays", () => {
  const form = withRegistered({ ...stopping({ max_flights: 12 }), name: "Mine" }, catalogue, wasp);
  expect(form).toMatchObject({
    name: "Mine",
    definition: {
      experiment: "takeoff-px4",
      strategy: "manual",
      start: { gains: { MPC_Z_P: 1 } },
      stop: { max_flights: 12 },
    },
  });
  expect(requestFrom(form, catalogue).vehicle).toEqual({ kind: "mavlink", id: 8 });
});

test("a vehicle stays where it flies the selected experiment; otherwise one must be chosen", () => {
  const hornet = { ...wasp, name: "Hornet", experiments: ["takeoff-px4", "altitude-steps-px4"] };
  const steps = { ...catalogue.experiments[1], name: "altitude-steps-px4", title: "Steps under PX4" };
  const wider = { ...catalogue, experiments: [...catalogue.experiments, steps] } as Catalogue;
  const form = withExperiment(withRegistered(start, wider, hornet), wider, "altitude-steps-px4");
  expect(form).toMatchObject({ registered: hornet, vehicle: { kind: "mavlink" }, name: "Steps under PX4, Hornet" });
  expect(withExperiment(form, wider, "takeoff")).toMatchObject({ registered: null, vehicle: { kind: "jsbsim" } });
  const other = withExperiment(withRegistered(start, wider, bee), wider, "altitude-steps-px4");
  expect(other).toMatchObject({ registered: null, vehicle: { kind: "" }, name: "Steps under PX4" });
  const twin = { ...withVehicle(start, wider, "twin"), vehicle: { kind: "twin", options: { mass_kg: 0.5 } } };
  expect(withExperiment(twin, wider, "takeoff").vehicle).toEqual(twin.vehicle);
});

test("a reason about bounds is given at the wrong one, or at both", () => {
  const kp = gain("kp", 4000, 283);
  expect(boundReasons(kp, [4001, 4000], "wrong")).toEqual(["wrong", undefined]);
  expect(boundReasons(kp, [0, 100.5], "wrong")).toEqual([undefined, "wrong"]);
  expect(boundReasons(kp, [300, 200], "wrong")).toEqual(["wrong", "wrong"]);
});

test("the height of steps is at most what the vehicle is commanded to fly to", () => {
  const options = [
    { name: "height_m", upper: 10 },
    { name: "step_m", upper: 1 },
  ];
  const kinds = [{ name: "twin" }, { name: "mavlink", highest_set_point_m: 3.5 }];
  const offered = {
    experiments: [{ name: "takeoff", options }],
    strategies: [],
    vehicle_kinds: kinds,
  } as unknown as Catalogue;
  const uppers = (kind: string) =>
    optionsFor({ ...start, vehicle: { kind, options: {} } }, offered).experiment.options.map(({ upper }) => upper);
  expect([uppers("twin"), uppers("mavlink")]).toEqual([
    [10, 1],
    [3.5, 1],
  ]);
});

const papers = {
  name: "paper",
  title: "The paper's method",
  line: "A gradient.",
  campaign: {
    name: "The paper's method",
    vehicle: { kind: "lti", options: {}, id: null },
    definition: {
      experiment: "pitch-tracking",
      experiment_options: { perturbation: 0.45 },
      strategy: "gradient",
      options: { scaled: false },
      start: { kind: "simplex", gains: null, donor: null, log: null },
      bounds: {},
      first_step_fraction: 0.25,
      step_fraction: 1,
      ceiling_m: 4.5,
      stop: { kind: "paper", max_flights: 27, improvement: 0.07, confidence: 0.9, min_battery_v: null },
      seed: 1,
    },
  },
} as unknown as Catalogue["presets"][number];

test("a preset fills in the whole form, and is named until a setting is changed", () => {
  const offering = { ...catalogue, presets: [papers] };
  const form = withPreset(startingForm(offering), offering, papers);
  const { min_battery_v: _, ...stop } = papers.campaign.definition.stop;
  expect(requestFrom(form, offering)).toEqual({
    name: "The paper's method",
    vehicle: { kind: "lti", options: {} },
    definition: { ...papers.campaign.definition, start: { kind: "simplex" }, stop },
  });
  expect(presetOf(form, offering)?.name).toBe("paper");
  expect(presetOf({ ...form, name: "Mine" }, offering)?.name).toBe("paper");
  expect(presetOf({ ...form, definition: { ...form.definition, seed: 2 } }, offering)).toBeUndefined();
  expect(presetOf(startingForm(offering), offering)).toBeUndefined();
});

test("a preset leaves a name that somebody has typed, and its own is no such name", () => {
  const offering = { ...catalogue, presets: [papers, ...catalogue.presets] };
  expect(withPreset({ ...start, name: "Mine" }, offering, papers).name).toBe("Mine");
  expect(withExperiment(withPreset(start, offering, papers), offering, "takeoff").name).toBe("Simulated takeoff");
});
