import { expect, test } from "vitest";
import type { LogNumbers, ParameterChange } from "../../api/logAnalyses";
import { changeText, factorText, parameterGroups, parameterText, QUANTITIES, quantityText } from "./readings";

const NUMBERS = {
  hover_throttle: { mean: 0.3646, deviation: 0.0021 },
  thrust_slope: null,
  deviation_m: 0.0234,
  activity: 0.00302,
  margin: 3.748,
  gains: {},
};
const NOTHING_KNOWN = { ...NUMBERS, hover_throttle: null, deviation_m: null, activity: null, margin: null };

const texts = (numbers: LogNumbers) => QUANTITIES.map((quantity) => quantityText(quantity, numbers));
const changes = (before: LogNumbers, now: LogNumbers) =>
  QUANTITIES.map((quantity) => changeText(quantity, before, now));

test("a log is told in numbers with their units, and a dash where it tells nothing", () => {
  expect(texts(NUMBERS)).toEqual(["23 mm", "0.3646 ± 0.0021", "0.3\u00a0%", "3.7"]);
  expect(texts({ ...NUMBERS, hover_throttle: { mean: 0.36392, deviation: 0.00003 } })[1]).toBe("0.364");
  expect(texts(NOTHING_KNOWN)).toEqual(["–", "–", "–", "–"]);
  expect(texts({ ...NUMBERS, margin: 0 }).at(-1)).toBe("less than 1");
  expect(texts({ ...NUMBERS, margin: 8 }).at(-1)).toBe("at least 8");
});

test("a change is told where both logs tell the number, and the margin is inside its range", () => {
  const now = { ...NUMBERS, deviation_m: 0.0117, activity: 0.00906, margin: 8 };
  expect(changes(NUMBERS, now)).toEqual(["−50\u00a0%", "0\u00a0%", "×3", "–"]);
  expect(changes(NOTHING_KNOWN, NUMBERS)).toEqual(["–", "–", "–", "–"]);
});

test.each([
  [0.838, "−16\u00a0%"],
  [1.034, "+3.4\u00a0%"],
  [2.31, "×2.3"],
])("the factor %s is told as %s", (factor, text) => expect(factorText(factor)).toBe(text));

test("parameters have the digits of single precision, and stand in groups, gains first", () => {
  expect([0.30000001192, -45, 1e-7, null].map(parameterText)).toEqual(["0.3", "−45", "1e-7", "not in the log"]);
  const named = (name: string, group: ParameterChange["group"]) => ({ name, group, before: 1, after: 2 });
  const groups = parameterGroups([named("STAT_RUNTIME", "self-written"), named("PSC_ACCZ_P", "gain")]);
  expect(groups.map(({ title, parameters }) => [title, parameters[0]?.name])).toEqual([
    ["Gains", "PSC_ACCZ_P"],
    ["Written by the autopilot itself", "STAT_RUNTIME"],
  ]);
});
