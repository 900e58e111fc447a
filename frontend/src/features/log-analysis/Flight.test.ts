import { expect, test } from "vitest";
import { readingsOf } from "./Flight";

const FLIGHT = {
  flown_s: 46.3,
  held_s: 35.1,
  altitude_range_m: 5.2,
  hover_throttle: 0.3634,
  hover_throttle_deviation: 0.0231,
  deviation_mean_m: 0.0261,
  deviation_largest_m: 1.234,
  saturated_share: 0.021,
  searched_s: 35.1,
  oscillation: { frequency_hz: 0.534, amplitude_m: 0.204, since_s: 34.2 },
};

const NOTHING = {
  hover_throttle: null,
  hover_throttle_deviation: null,
  deviation_mean_m: null,
  deviation_largest_m: null,
  saturated_share: null,
  searched_s: 0,
  oscillation: null,
};

test("a flight is told in numbers with their units", () => {
  expect(readingsOf(FLIGHT).map(({ value, detail }) => `${value} ${detail}`)).toEqual([
    "46 s 35 s with the altitude held",
    "0.363 ± 0.023",
    "26 mm at most 1.23 m",
    "±204 mm 0.53 Hz, since 34 s",
    "2.1\u00a0% of the time",
  ]);
});

test("what is not known has no place, and no oscillation is told as none", () => {
  const calm = { ...FLIGHT, oscillation: null, saturated_share: 0 };
  expect(readingsOf(calm).map(({ title }) => title)).toEqual([
    "In the air",
    "Hover throttle",
    "Mean deviation",
    "Oscillation",
  ]);
  expect(readingsOf(calm).at(-1)?.value).toBe("none");
  expect(readingsOf({ ...FLIGHT, ...NOTHING, held_s: 0 })).toEqual([{ title: "In the air", value: "46 s" }]);
});
