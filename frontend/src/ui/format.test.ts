import { expect, test } from "vitest";
import {
  against,
  asSentence,
  bytesText,
  count,
  flightNumbers,
  flightsText,
  gainText,
  grouped,
  localTime,
  NOTHING,
  percentChange,
  readNumber,
  stopped,
  typed,
  typedGain,
  unitAfter,
  utcTime,
  withUnit,
} from "./format";

test("an error is printed to the millimetre, with its unit", () => {
  expect(withUnit(0.13189333802782058, "m")).toBe("0.132 m");
  expect(withUnit(-0.001, "m", 2)).toBe("0.00 m");
  expect(withUnit(-0.15, "m", 2)).toBe("−0.15 m");
  expect(withUnit(null, "m")).toBe(NOTHING);
  expect(withUnit(Number.NaN, "m")).toBe(NOTHING);
});

test("a change is told in words, and one too small to print is none", () => {
  expect(against(-58.6, "the best")).toBe("59\u00a0% below the best");
  expect(against(12.4, "flight 1")).toBe("12\u00a0% above flight 1");
  expect(against(-0.3, "the best")).toBe("the same as the best");
});

test("percent against nothing is nothing", () => {
  expect(percentChange(0.2, 0.4)).toBe(-50);
  expect(percentChange(0.2, null)).toBeNull();
  expect(percentChange(0.2, 0)).toBeNull();
});

test("whole gains stay whole and others are short", () => {
  expect(gainText(283)).toBe("283");
  expect(gainText(0.123456)).toBe("0.1235");
});

test("a time can be read in UTC", () => {
  expect(utcTime("2026-11-02T10:00:00.123+01:00")).toBe("2026-11-02 09:00:00 UTC");
});

test("a local time names the year only when it is another one", () => {
  const at = "2026-07-02T12:00:00Z";
  expect(localTime(at, { now: new Date("2026-12-01T00:00:00Z") })).not.toContain("2026");
  expect(localTime(at, { now: new Date("2027-12-01T00:00:00Z") })).toContain("2026");
  expect(localTime(null)).toBe(NOTHING);
  expect(localTime("2026-11-23T09:05:07Z", { seconds: true })).toMatch(/:05:07/);
});

test("one flight is singular", () => {
  expect([count(0, "flight"), count(1, "flight"), count(7, "flight")]).toEqual(["0 flights", "1 flight", "7 flights"]);
});

test("sizes are told in the digits that matter", () => {
  expect([400, 12_345, 9_960_000, 87_654_321, 1.44e12].map(bytesText)).toEqual([
    "0.4 kB",
    "12 kB",
    "10.0 MB",
    "88 MB",
    "1.4 TB",
  ]);
});

test("flight numbers are listed in runs, and counted where there are many", () => {
  const scattered = [2, 4, 6, 8, 10, 12];
  expect([flightsText([3]), flightsText([3, 4]), flightsText([1, 2, 3, 7])]).toEqual([
    "flight 3",
    "flights 3, 4",
    "flights 1–3, 7",
  ]);
  expect(flightsText(Array.from({ length: 500 }, (_, index) => index + 1))).toBe("flights 1–500");
  expect(flightsText(scattered)).toBe("6 flights from 2 to 12");
  expect([flightNumbers([1, 2, 3]), flightNumbers(scattered)]).toEqual(["1–3", "6, from 2 to 12"]);
});

test("large counts come in groups of three", () => {
  expect([7, 999, 1000, 16_700, 1_234_567].map(grouped)).toEqual([
    "7",
    "999",
    "1\u2009000",
    "16\u2009700",
    "1\u2009234\u2009567",
  ]);
});

test.each([
  ["12.5", 12.5],
  ["-5", -5],
  ["−5", -5],
  [" 400 ", 400],
  ["+3", 3],
  [".5", 0.5],
  ["7.", 7],
  ["-0", 0],
  ["1e9", 1e9],
  ["2.5E-3", 0.0025],
])("%s is read as a number", (text, value) => {
  expect(readNumber(text)).toEqual({ value });
});

test.each([
  "1e400",
  "e9",
  "1e",
  "NaN",
  "Infinity",
  "abc",
  "",
  "  ",
  "1 000",
  "1,5",
  "0x10",
  "1.2.3",
  "--1",
  "9".repeat(400),
])("“%s” is refused with a reason", (text) => {
  const { value, reason } = readNumber(text);
  expect(value).toBeUndefined();
  expect(reason).toMatch(/\.$/);
});

test("a comma is answered with what is right for the field", () => {
  expect(readNumber("32,6").reason).toBe("Use a decimal point, not a comma: 32.6.");
  expect(readNumber("283,5", true).reason).toBe("Enter a whole number, without a comma.");
  expect(readNumber("1500.5", true).reason).toBe("Enter a whole number.");
  expect(readNumber("1,000,000", true).reason).toContain("is not a number. Enter a whole number such as 400.");
});

test("what a field is filled with can be read again", () => {
  const values = [400, -50.25, 1e-7, 0, 1e30, 2.5e-30];
  expect(values.map((value) => readNumber(typed(value)).value)).toEqual(values);
  expect(typedGain(-50.123456789)).toBe("-50.1235");
  expect(typedGain(1234567)).toBe("1234567");
});

test("a number without a unit is printed alone", () => {
  expect([unitAfter("1"), unitAfter(""), unitAfter("m")]).toEqual(["", "", " m"]);
  expect(`2${unitAfter("10 %·s²/m")}`).toBe("2 (10 %·s²/m)");
});

test("an error of more than twice another is a multiple of it", () => {
  expect([against(315, "the best"), against(80, "the best")]).toEqual([
    "4.2 times the best",
    "80\u00a0% above the best",
  ]);
});

test("a reason ends with one full stop", () => {
  const reasons = ["is a log of another autopilot", "is too long.", "Which one?"];
  expect(reasons.map(stopped)).toEqual(["is a log of another autopilot.", "is too long.", "Which one?"]);
});

test("a fragment becomes a sentence", () => {
  expect(asSentence("its process ended")).toBe("Its process ended.");
  expect(asSentence("The vehicle rebooted.")).toBe("The vehicle rebooted.");
  expect(asSentence("")).toBe("");
});
