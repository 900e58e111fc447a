import { describe, expect, test } from "vitest";
import { confidenceText, decimalsOf, intervalText, percent, plusMinus, rangeText } from "./uncertainty";

describe("a number with its uncertainty", () => {
  test.each([
    [0.10537, 0.01234, "0.105 ± 0.012 m"],
    [0.13189, 0.00702, "0.132 ± 0.007 m"],
    [0.2273, 0.0141, "0.227 ± 0.014 m"],
    [3.3818, 0.21, "3.38 ± 0.21 m"],
    [152.3, 41, "152 ± 41 m"],
    [0.63, 0.00052, "0.6300 ± 0.0005 m"],
  ])("%d ± %d is written as %s", (value, uncertainty, text) => {
    expect(plusMinus(value, uncertainty, "m")).toBe(text);
  });

  test("without an uncertainty it keeps three digits after the point", () => {
    expect(plusMinus(0.13189, null, "m")).toBe("0.132 m");
    expect(plusMinus(0.13189, 0, "")).toBe("0.132");
    expect([0.00391, 0.0096, 0.000041].map((error) => plusMinus(error, null, "m"))).toEqual([
      "0.0039 m",
      "0.010 m",
      "0.000041 m",
    ]);
    expect(plusMinus(null, 0.1, "m")).toBe("–");
    expect(plusMinus(Number.NaN, 0.1, "m")).toBe("–");
  });

  test("never asks for more digits than a page can carry", () => {
    expect(decimalsOf(1e-12)).toBe(6);
    expect(decimalsOf(1e9)).toBe(0);
    expect(decimalsOf(undefined)).toBe(3);
  });
});

test("an interval shows both ends, in the digits of an error, and its confidence", () => {
  expect(intervalText({ lower: 0.093, upper: 0.1174, confidence: 0.9 }, "m")).toBe("0.093 … 0.117 m (90\u00a0%)");
  expect(rangeText({ lower: 0, upper: 2.2, confidence: 0.9 }, "m")).toBe("0.000 … 2.200 m");
  expect(rangeText({ lower: 0.0036, upper: 0.0042, confidence: 0.9 }, "m")).toBe("0.0036 … 0.0042 m");
});

test("a share is a percentage, and certainty is not claimed", () => {
  expect([percent(0.9), percent(0.995), percent(1)]).toEqual(["90\u00a0%", "99.5\u00a0%", "100\u00a0%"]);
  expect([0.93, 0.9971, 0.9999].map(confidenceText)).toEqual(["93\u00a0%", "99.7\u00a0%", "more than 99.9\u00a0%"]);
});
