import { describe, expect, it } from "vitest";
import type { AssessedGains, LogAnalysis } from "../../api/logAnalyses";
import { behaviourOf, gainsTable, vehicleOf } from "./logAnalysis";

const assessed = (more: Partial<AssessedGains>): AssessedGains => ({
  name: "As flown",
  gains: { PSC_POSZ_P: 1, PSC_ACCZ_P: 0.5 },
  error_m: 0.0269,
  low_m: 0.0245,
  high_m: 0.0305,
  activity: 1,
  margin: 3.73,
  ...more,
});

const PROPOSED = assessed({
  name: "Proposed",
  gains: { PSC_POSZ_P: 3, PSC_ACCZ_P: 0.854 },
  error_m: 0.0042,
  low_m: 0.0031,
  high_m: 0.0058,
  activity: 1.14,
  margin: 2.04,
});

const analysis = (more: Partial<LogAnalysis> = {}): LogAnalysis => ({
  file_name: "steps.bin",
  answer: "",
  behaviour: {
    duration_s: 21.7,
    error_m: 0.0234,
    largest_deviation_m: 0.0632,
    reference_range_m: 2.42,
    throttle_mean: 0.3631,
    saturated_share: 0,
  },
  vehicle: {
    hover_throttle: { mean: 0.3646, deviation: 0.0001 },
    assumed_hover_throttle: 0.39,
    thrust_slope: { mean: 0.998, deviation: 0.004 },
    motor_lag_s: { mean: 0.051, deviation: 0.0124 },
    drag_1_s: { mean: 0.302, deviation: 0.03 },
    residual_m_s2: 0.0098,
  },
  proposed: PROPOSED,
  insufficient: null,
  assessments: [assessed({}), assessed({ name: "stiff", margin: 0 }), assessed({ name: "soft", margin: 8 })],
  at_limit: [],
  parameter_file: null,
  figures: {},
  ...more,
});

describe("a log analysis", () => {
  it("tells the flight and the vehicle in facts", () => {
    expect(behaviourOf(analysis())).toEqual([
      "22 s analysed",
      "reference moves by 2.4 m",
      "deviation 23.4 mm in the mean, 63.2 mm at most",
      "throttle 0.363 in the mean",
    ]);
    expect(vehicleOf(analysis())).toEqual([
      "hover throttle 0.365",
      "thrust slope 1.00 ± 0.01",
      "motor lag 51 ± 12 ms",
      "drag 0.30 ± 0.03 1/s",
      "0.01 m/s² of acceleration unexplained",
    ]);
  });

  it("warns of saturation and of a wrong hover throttle", () => {
    const found = analysis();
    found.behaviour.saturated_share = 0.021;
    found.vehicle.assumed_hover_throttle = 0.3;
    expect(behaviourOf(found).at(-1)).toBe("throttle at a limit in 2 % of the rows");
    expect(vehicleOf(found)[0]).toBe("hover throttle 0.365, but MOT_THST_HOVER was 0.300");
  });

  it("lists the proposed gains after those flown", () => {
    const table = gainsTable(analysis());
    expect(table.columns.map(({ title }) => title).slice(0, 3)).toEqual(["Gains", "POSZ_P", "ACCZ_P"]);
    expect(table.rows).toEqual([
      ["As flown", "1", "0.5", "26.9 mm", "24.5 … 30.5 mm", "1.00", "3.7"],
      ["Proposed", "3", "0.854", "4.2 mm", "3.1 … 5.8 mm", "1.14", "2.0"],
      ["stiff", "1", "0.5", "26.9 mm", "24.5 … 30.5 mm", "1.00", "< 1"],
      ["soft", "1", "0.5", "26.9 mm", "24.5 … 30.5 mm", "1.00", "> 8"],
    ]);
  });
});
