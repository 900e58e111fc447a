import { expect, test } from "vitest";
import { readNumber, typed, typedGain } from "./numbers";

test.each([
  ["12.5", 12.5],
  ["-5", -5],
  ["−5", -5],
  [" 400 ", 400],
  ["+3", 3],
  [".5", 0.5],
  ["7.", 7],
  ["-0", 0],
])("%s is read as a number", (text, value) => {
  expect(readNumber(text)).toEqual({ value });
});

test.each(["1e9", "NaN", "Infinity", "abc", "", "  ", "1 000", "1,5", "0x10", "1.2.3", "--1", "9".repeat(400)])(
  "“%s” is refused with a reason",
  (text) => {
    const { value, reason } = readNumber(text);
    expect(value).toBeUndefined();
    expect(reason).toMatch(/\.$/);
  },
);

test("what a field is filled with can be read again", () => {
  expect([400, -50.25, 1e-7, 0].map((value) => readNumber(typed(value)).value)).toEqual([400, -50.25, 1e-7, 0]);
  expect(typedGain(-50.123456789)).toBe("-50.1235");
  expect(typedGain(1234567)).toBe("1234567");
});
