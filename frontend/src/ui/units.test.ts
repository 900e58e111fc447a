import { expect, test } from "vitest";
import type { Catalogue } from "../api/types";
import { gainTitles, offeredExperiments, replacementOf, unitsOf } from "./units";

const catalogue = {
  experiments: [
    { name: "takeoff", error_unit: "m", output_unit: "m", gains: [{ unit: "counts" }, { unit: "counts" }] },
    {
      name: "pitch-tracking",
      error_unit: "rad·s",
      output_unit: "rad",
      gains: [
        { name: "theta_1", title: "Thrust per speed", unit: "lb s/ft" },
        { name: "theta_2", title: "Thrust offset", unit: "deg" },
      ],
    },
  ],
} as unknown as Catalogue;

test("units are those of the campaign's experiment", () => {
  expect(unitsOf(catalogue, "takeoff")).toEqual({ error: "m", output: "m", gains: "counts", setPoint: 3 });
  expect(unitsOf(catalogue, "pitch-tracking")).toEqual({ error: "rad·s", output: "rad", gains: "", setPoint: 0 });
});

test("a gain has a name that says what it is, once the catalogue is there", () => {
  expect(gainTitles(catalogue, "pitch-tracking")).toEqual({ theta_1: "Thrust per speed", theta_2: "Thrust offset" });
  expect(gainTitles(undefined, "pitch-tracking")).toEqual({});
});

test("until the catalogue is there a takeoff is likeliest", () => {
  expect(unitsOf(undefined, "takeoff").error).toBe("m");
});

test("an experiment that no vehicle flies in a new campaign is replaced by another of its autopilot", () => {
  const [takeoff, old, steps] = ["takeoff", "takeoff-px4", "altitude-steps-px4"];
  const px4 = {
    experiments: [takeoff, old, steps].map((name) => ({ name, title: `Title of ${name}` })),
    vehicle_kinds: [{ experiments: [takeoff] }, { experiments: [takeoff, steps] }],
    autopilots: [{ experiments: [takeoff] }, { experiments: [old, steps] }],
  } as unknown as Catalogue;
  expect(offeredExperiments(px4).map(({ name }) => name)).toEqual([takeoff, steps]);
  expect(replacementOf(px4, old)).toBe("Title of altitude-steps-px4");
  expect(replacementOf(px4, steps)).toBeUndefined();
});
