import { expect, test } from "vitest";
import {
  begun,
  extended,
  isSaturated,
  type LiveFlight,
  outputNow,
  readingOf,
  telemetryFrom,
  throttleNow,
  underWay,
  withFlight,
} from "./telemetry";
import type { Aged } from "./vehicleStatus";

const line = JSON.stringify({
  type: "telemetry",
  campaign_id: 1,
  trial_id: 5,
  time_s: 0.04,
  columns: ["time_s", "altitude_m", "climb_rate_m_s", "set_point_m", "reference_m", "thrust", "battery_v"],
  samples: [
    [0.02, 0.1, 0.5, 3, 0.1, 0.8, 11.9],
    [0.04, 0.2, 0.6, 3, 0.1, 0.9, 11.8],
  ],
  error_so_far: 2.9,
});

function told() {
  const news = telemetryFrom(line);
  if (news === null) throw new Error("the line above is telemetry");
  return news;
}

test("telemetry grows the curve and updates the readings", () => {
  const readings = { throttle: 0.9, batteryV: 11.8, errorSoFar: 2.9 };
  expect(extended(begun(1, 5), told())).toMatchObject({ timeS: [0.02, 0.04], measured: [0.1, 0.2], ...readings });
});

test("another experiment sends other columns, the scored one second", () => {
  const columns = ["time_s", "pitch_error_rad", "elevator_rad"];
  const flight = extended(begun(1, 5), { ...news, columns, samples: [[1, -0.02, 0.1]] });
  expect(flight).toMatchObject({ channel: "pitch_error_rad", measured: [-0.02], throttle: null, batteryV: null });
  expect(readingOf(flight.channel)).toEqual({ title: "Pitch error", unit: "rad", digits: 3 });
});

test("samples that come twice after a reconnect are drawn once", () => {
  expect(extended(extended(begun(1, 5), told()), told()).timeS).toEqual([0.02, 0.04]);
});

test("flights of long ago are forgotten, those under way are not", () => {
  let flights: ReadonlyMap<number, LiveFlight> = new Map();
  for (let trial = 1; trial <= 20; trial += 1) {
    flights = withFlight(withFlight(flights, begun(1, trial)), begun(1, 99));
  }
  expect([...flights.keys()]).toEqual([14, 15, 16, 17, 18, 19, 20, 99]);
});

test("what waits on the ground, has landed or ended is not under way: Space is a blank again there", () => {
  const phases = ["staging", "staged", "flying", "landed", "ended"];
  const flights = new Map(phases.map((phase, trialId) => [trialId, { ...begun(1, trialId), phase }]));
  expect(underWay(flights).map(({ phase }) => phase)).toEqual(["staging", "flying"]);
});

test("a line that is no telemetry is left alone", () => {
  expect(telemetryFrom('{"type":"telemetry"}')).toBeNull();
  expect(telemetryFrom("null")).toBeNull();
});

const news = { campaign_id: 1, trial_id: 5, time_s: 1, error_so_far: 0.1, age_s: 0 };

test("a reported throttle is shown until its reports end", () => {
  const reported = { ...news, columns: ["time_s", "altitude_m", "throttle"], samples: [[1, 0.5, 0.62]] };
  const flight = extended(begun(1, 5), reported);
  expect(flight.throttle).toBe(0.62);
  expect(extended(flight, { ...news, columns: ["time_s", "altitude_m"], samples: [] }).throttle).toBe(0.62);
  expect(extended(flight, { ...news, columns: ["time_s", "altitude_m"], samples: [[2, 0.6]] }).throttle).toBeNull();
});

test("a report of zero throttle just after the lift-off is from before it, and is not shown", () => {
  const columns = ["time_s", "altitude_m", "throttle"];
  const climb = [0.5, 1, 3, 6].map((time) => [time, time < 1 ? 0 : 0.5 * time, 0]);
  const shown = climb.map((row) =>
    extended(begun(1, 5), { ...news, columns, samples: [...climb.slice(0, climb.indexOf(row)), row] }),
  );
  expect(shown.map(({ throttle }) => throttle)).toEqual([0, null, null, 0]);
  expect(
    extended(begun(1, 5), { ...news, columns: ["time_s", "altitude_m", "thrust"], samples: climb.slice(0, 2) })
      .throttle,
  ).toBe(0);
});

test("once the record is complete the altitude is the vehicle's own, and its throttle is not known", () => {
  const flight = { ...begun(1, 5), measured: [3.01], throttle: 0.6 };
  const at = (step: string) => ({ status: { step, altitudeM: 1.2 } }) as Aged;
  expect(["record", "abort-land", "land", "disarm"].map((step) => outputNow(flight, at(step)))).toEqual([
    3.01, 3.01, 1.2, 1.2,
  ]);
  expect(["record", "land"].map((step) => throttleNow(flight, at(step)))).toEqual([0.6, null]);
  expect([outputNow(flight, null), throttleNow(flight, null)]).toEqual([3.01, 0.6]);
});

test.each([
  [1, 0, true],
  [0.62, 2, false],
  [0, 2, true],
  [0, 0.05, false],
  [null, 2, false],
])("throttle %s at %s m is saturated: %s", (throttle, altitude, expected) => {
  expect(isSaturated({ ...begun(1, 5), throttle, measured: [altitude] })).toBe(expected);
});
