import { expect, test } from "vitest";
import type { Catalogue } from "../api/types";
import { unitsOf } from "./units";

const catalogue = {
  experiments: [
    { name: "takeoff", error_unit: "m", output_unit: "m", gains: [{ unit: "counts" }, { unit: "counts" }] },
    { name: "pitch-tracking", error_unit: "rad·s", output_unit: "rad", gains: [{ unit: "lb s/ft" }, { unit: "deg" }] },
  ],
} as unknown as Catalogue;

test("units are those of the campaign's experiment", () => {
  expect(unitsOf(catalogue, "takeoff")).toEqual({ error: "m", output: "m", gains: "counts" });
  expect(unitsOf(catalogue, "pitch-tracking")).toEqual({ error: "rad·s", output: "rad", gains: "" });
});

test("until the catalogue is there a takeoff is likeliest", () => {
  expect(unitsOf(undefined, "takeoff").error).toBe("m");
});
