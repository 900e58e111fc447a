import { expect, test } from "vitest";
import type { Catalogue } from "../api/types";
import { fieldsOf, firstPreset, requestFrom, startingForm, vehicleOrder, withVehicle } from "./newCampaign";

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
  experiments: [{ name: "takeoff", gains: [gain("kp", 4000, 283), gain("ki", 1073, 13), gain("kd", 409, 82)] }],
  strategies: [
    { name: "gradient", options: [{ name: "scaled", title: "Scaled", default: true, choices: [true, false] }] },
  ],
  vehicle_kinds: [
    { name: "import", can_fly: false, options: [] },
    { name: "twin", can_fly: true, options: [] },
    { name: "jsbsim", can_fly: true, options: [{ name: "mass_kg" }] },
  ],
  presets: [
    { name: "twin", title: "Twin takeoff", campaign: { vehicle: { kind: "twin" } } },
    { name: "ardrone", title: "Simulated takeoff", campaign: { vehicle: { kind: "jsbsim" } } },
  ],
} as unknown as Catalogue;

test("the form as it comes creates the paper's campaign on the simulation", () => {
  const form = startingForm(catalogue);
  expect(requestFrom(form, catalogue)).toEqual({
    name: "Simulated takeoff",
    vehicle: { kind: "jsbsim", options: {} },
    definition: {
      experiment: "takeoff",
      strategy: "gradient",
      options: {},
      start: { kind: "default" },
      bounds: {},
      first_step_fraction: 0.25,
      step_fraction: 1,
      stop: { kind: "paper", max_flights: 7, improvement: 0.05 },
      seed: 1,
    },
  });
});

test("bounds are sent only where they are tighter", () => {
  const form = { ...startingForm(catalogue), bounds: { kp: [0, 2000], ki: [0, 1073], kd: ["", 409] } } as ReturnType<
    typeof startingForm
  >;
  expect(requestFrom(form, catalogue).definition?.bounds).toEqual({ kp: [0, 2000] });
});

test("given start gains leave out what is empty, so that the server names it", () => {
  const form = { ...startingForm(catalogue), start: "given" as const, startGains: { kp: 400, ki: "", kd: -1 } };
  expect(requestFrom(form, catalogue).definition?.start).toEqual({ kind: "given", gains: { kp: 400, kd: -1 } });
});

test("a wrong number is sent as it is, for the server to refuse", () => {
  const form = { ...startingForm(catalogue), maxFlights: -3, improvementPercent: 7.5 };
  expect(requestFrom(form, catalogue).definition?.stop).toEqual({ kind: "paper", max_flights: -3, improvement: 0.075 });
});

test("a name follows the vehicle until somebody has changed it", () => {
  const form = startingForm(catalogue);
  expect(withVehicle(form, catalogue, "twin").name).toBe("Twin takeoff");
  expect(withVehicle({ ...form, name: "Mine" }, catalogue, "twin").name).toBe("Mine");
  expect(withVehicle({ ...form, vehicleOptions: { mass_kg: 0.5 } }, catalogue, "twin").vehicleOptions).toEqual({});
});

test("the simulation is offered first, flights made elsewhere last", () => {
  expect(vehicleOrder(catalogue.vehicle_kinds).map(({ name }) => name)).toEqual(["jsbsim", "twin", "import"]);
  expect(firstPreset(catalogue)?.name).toBe("ardrone");
});

test("every refusable field has its place in the form", () => {
  const form = startingForm(catalogue);
  expect(fieldsOf(form, catalogue).plain).not.toContain("start.gains.kp");
  expect(fieldsOf({ ...form, start: "given" }, catalogue).plain).toContain("start.gains.kp");
  expect(fieldsOf(form, catalogue).advanced).toEqual(
    expect.arrayContaining(["stop.max_flights", "bounds.kd", "vehicle.options.mass_kg", "definition.options.scaled"]),
  );
});
