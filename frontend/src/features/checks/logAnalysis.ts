/** Texts and tables of a log analysis. */

import type { AssessedGains, LogAnalysis } from "../../api/logAnalyses";
import type { FigureTable } from "../../api/types";
import { gainText } from "../../ui/format";

const LARGEST_MARGIN = 8;
const HOVER_DIFFERENCE = 0.1;

const millimetres = (metres: number): string => `${(1000 * metres).toFixed(1)} mm`;

/** What the flight was, as separate facts. */
export function behaviourOf({ behaviour }: LogAnalysis): string[] {
  const { duration_s, reference_range_m, error_m, largest_deviation_m, throttle_mean, saturated_share } = behaviour;
  return [
    `${duration_s.toFixed(0)} s analysed`,
    `reference moves by ${reference_range_m.toFixed(1)} m`,
    `deviation ${millimetres(error_m)} in the mean, ${millimetres(largest_deviation_m)} at most`,
    `throttle ${throttle_mean.toFixed(3)} in the mean`,
    ...(saturated_share > 0 ? [`throttle at a limit in ${(100 * saturated_share).toFixed(0)} % of the rows`] : []),
  ];
}

/** The vehicle behind the log, as separate facts. */
export function vehicleOf({ vehicle }: LogAnalysis): string[] {
  const { hover_throttle, assumed_hover_throttle, thrust_slope, motor_lag_s, drag_1_s, residual_m_s2 } = vehicle;
  const spread = (deviation: number): string => Math.max(deviation, 0.01).toFixed(2);
  const off = Math.abs(hover_throttle.mean / assumed_hover_throttle - 1) > HOVER_DIFFERENCE;
  return [
    `hover throttle ${hover_throttle.mean.toFixed(3)}${off ? `, but MOT_THST_HOVER was ${assumed_hover_throttle.toFixed(3)}` : ""}`,
    `thrust slope ${thrust_slope.mean.toFixed(2)} ± ${spread(thrust_slope.deviation)}`,
    `motor lag ${(1000 * motor_lag_s.mean).toFixed(0)} ± ${(1000 * motor_lag_s.deviation).toFixed(0)} ms`,
    `drag ${drag_1_s.mean.toFixed(2)} ± ${spread(drag_1_s.deviation)} 1/s`,
    `${residual_m_s2.toFixed(2)} m/s² of acceleration unexplained`,
  ];
}

/** One row for each gain set, the proposed one second. */
export function gainsTable({ proposed, assessments }: LogAnalysis): FigureTable {
  const [present, ...others] = assessments;
  const listed = [...(present ? [present] : []), ...(proposed ? [proposed] : []), ...others];
  const names = Object.keys(present?.gains ?? {});
  const column = (name: string, title = name) => ({ name, title, unit: "", digits: null });
  return {
    columns: [
      column("set", "Gains"),
      ...names.map((name) => column(name, name.replace("PSC_", ""))),
      column("error", "Deviation"),
      column("interval", "90 % interval"),
      column("activity", "Activity"),
      column("margin", "Margin"),
    ],
    rows: listed.map((each) => [
      each.name,
      ...names.map((name) => gainText(each.gains[name] ?? 0)),
      millimetres(each.error_m),
      `${(1000 * each.low_m).toFixed(1)} … ${millimetres(each.high_m)}`,
      each.activity.toFixed(2),
      marginText(each),
    ]),
  };
}

function marginText({ margin }: AssessedGains): string {
  if (margin === 0) return "< 1";
  return margin < LARGEST_MARGIN ? margin.toFixed(1) : `> ${LARGEST_MARGIN}`;
}
