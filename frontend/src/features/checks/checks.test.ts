import { describe, expect, it } from "vitest";
import type { SignalResult } from "../../api/checks";
import { allowances, signalsTable } from "./checks";

const signal = (more: Partial<SignalResult>): SignalResult => ({
  name: "thrust",
  title: "Commanded thrust",
  largest_difference: 0,
  difference_unit: "counts",
  tolerance: 0,
  allowance: "to the last bit",
  verdict: "exact",
  different: 0,
  first_different_s: null,
  median_difference: null,
  ...more,
});

describe("a controller check", () => {
  it("has one line for each signal, with where it differs", () => {
    const wrong = signal({
      name: "z_ref",
      title: "Reference altitude",
      largest_difference: 0.123456,
      difference_unit: "m",
      tolerance: 0.01,
      verdict: "differs",
      different: 3,
      first_different_s: 1.953125,
    });
    expect(signalsTable([signal({}), wrong]).rows).toEqual([
      ["thrust, commanded thrust", "0 counts", "0 counts", "exact", "–"],
      ["z_ref, reference altitude", "0.12 m", "0.01 m", "differs", "3 samples, from 1.953 s"],
    ]);
  });

  it("shows the median beside the largest difference where it decides", () => {
    const judged = signal({
      largest_difference: 0.42,
      difference_unit: "m/s²",
      tolerance: 0.0005,
      median_difference: 0.000021,
      verdict: "agrees",
      different: 3,
      first_different_s: 1.5,
    });
    const { columns, rows } = signalsTable([judged]);
    expect(columns.map(({ title }) => title)).toContain("Allowed median");
    expect(rows).toEqual([
      ["thrust, commanded thrust", "0.42 m/s²", "0.000021 m/s²", "0.0005 m/s²", "agrees", "3 samples, from 1.500 s"],
    ]);
  });

  it("says once what is allowed of several signals", () => {
    const signals = [signal({ name: "ff_cmd" }), signal({}), signal({ name: "z_ref", allowance: "within 20 ms" })];
    expect(allowances(signals)).toEqual(["ff_cmd, thrust: to the last bit.", "z_ref: within 20 ms."]);
  });
});
