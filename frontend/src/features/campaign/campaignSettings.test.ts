import { expect, test } from "vitest";
import type { Campaign, Catalogue } from "../../api/types";
import { settingsOf, windowOf } from "./campaignSettings";

const campaign = {
  definition: {
    experiment: "takeoff",
    strategy: "gradient",
    options: { scaled: false },
    start: { kind: "given", gains: { kp: 400, ki: 20, kd: 100 } },
    stop: { kind: "paper", max_flights: 7, improvement: 0.05 },
    bounds: { kp: [0, 2000] },
    first_step_fraction: 0.25,
    step_fraction: 1,
    seed: 3,
  },
  vehicle: {
    kind: "jsbsim",
    title: "JSBSim",
    can_fly: true,
    registered: false,
    options: { mass_kg: 0.42, wind_from_deg: 90 },
  },
  definition_digest: "0123456789abcdef",
} as unknown as Campaign;

const MASS = { name: "mass_kg", title: "Mass", unit: "kg" };
const WIND = { name: "wind_from_deg", title: "Wind from", unit: "°" };

const catalogue = {
  experiments: [{ name: "takeoff", title: "Takeoff to 3 m", gains: [{ name: "kp", unit: "counts" }] }],
  strategies: [{ name: "gradient", title: "Gradient", options: [{ name: "scaled", title: "Scaled gains" }] }],
  vehicle_kinds: [{ name: "jsbsim", options: [MASS, WIND] }],
} as unknown as Catalogue;

test("every setting that a proposal depends on is said in words", () => {
  const rows = Object.fromEntries(settingsOf(campaign, catalogue));
  expect(rows).toMatchObject({
    Mass: "0.42 kg",
    "Wind from": "90°",
    Experiment: "Takeoff to 3 m",
    Strategy: "Gradient",
    "Scaled gains": "no",
    Start: "[400 20 100]",
    "Bounds of kp": "0 … 2000 counts",
    "Maximum step": "25\u00a0% of each gain's range until the first valid flight, then 100\u00a0%",
    Seed: "3",
    "Definition digest": "0123456789ab",
  });
  const linked = { ...campaign, vehicle: { ...campaign.vehicle, registered: true } };
  expect(settingsOf(linked, catalogue).map(([title]) => title)).not.toContain("Seed");
  expect(rows["Stop rule"]).toBe(
    "Two consecutive flights less than 5\u00a0% better than the best, or 7 flights, invalid ones not counted",
  );
  expect(Object.fromEntries(settingsOf({ ...campaign, open_until_flight: 8 }, catalogue))["Stop rule"]).toBe(
    "Two consecutive flights less than 5\u00a0% better than the best, or 7 flights and 1 more after reopening, invalid ones not counted",
  );
});

test("a warm start and a stop on noise are said in words", () => {
  const definition = {
    ...campaign.definition,
    start: {
      kind: "campaign" as const,
      gains: { kp: 900, ki: 200, kd: 200 },
      donor: { campaign_id: 4, trial_number: 2, checksum: "ab" },
      log: null,
    },
    stop: { kind: "noise" as const, max_flights: 12, improvement: 0.05, confidence: 0.95, min_battery_v: 10.8 },
  };
  expect(Object.fromEntries(settingsOf({ ...campaign, definition }, catalogue))).toMatchObject({
    Start: "[900 200 200], flight 2 of campaign 4",
    "Stop rule": "No resolvable improvement at 95\u00a0% confidence, or 12 flights, invalid ones not counted",
    "Minimum battery voltage": "10.8 V after a flight",
  });
});

test("the scored window is the campaign's own, or else the experiment's default", () => {
  const option = { name: "window_s", title: "Scored window", unit: "s", default: 32.6 };
  const offering = {
    ...catalogue,
    experiments: catalogue.experiments.map((one) => ({ ...one, options: [option] })),
  } as unknown as Catalogue;
  const shorter = { ...campaign.definition, experiment_options: { window_s: 20 } };
  expect(windowOf(campaign.definition, offering)).toBe(32.6);
  expect(windowOf(shorter, offering)).toBe(20);
  expect(windowOf(shorter)).toBe(20);
  expect(windowOf(campaign.definition)).toBeNull();
  expect(Object.fromEntries(settingsOf(campaign, offering))).toMatchObject({ "Scored window": "32.6 s" });
});

test("until the catalogue is there, options stand under their names", () => {
  expect(Object.fromEntries(settingsOf(campaign))).toMatchObject({
    mass_kg: "0.42",
    scaled: "no",
    Experiment: "takeoff",
  });
});

test("a draft is not frozen yet", () => {
  expect(Object.fromEntries(settingsOf({ ...campaign, definition_digest: null }))).not.toHaveProperty(
    "Definition digest",
  );
});

test("settings of the vehicle that are at their defaults are left out, unknown ones are not", () => {
  const kind = { name: "jsbsim", options: [{ ...WIND, default: 90 }] };
  const names = settingsOf(campaign, { ...catalogue, vehicle_kinds: [kind] } as Catalogue).map(([name]) => name);
  expect(names).toContain("mass_kg");
  expect(names).not.toContain("Wind from");
});
