import { expect, test } from "vitest";
import { path, scaleFor } from "./Sparkline";

const box = { width: 100, height: 50 };

test("a curve is drawn from the lower left, its set point below the upper edge", () => {
  const curve = [
    [0, 0],
    [5, 3],
    [10, 3],
  ] as const;
  const scale = scaleFor([curve], 3);
  expect(scale).toEqual({ x: [0, 10], y: [0, 4.050000000000001] });
  expect(path(curve, scale, box)).toBe("M0.0 50.0C16.7 37.7 33.3 13.0 50.0 13.0C66.7 13.0 83.3 13.0 100.0 13.0");
});

test("between its points a curve never goes beyond them", () => {
  const curve = [0, 2, 3.6, 3.6, 2.9, 3].map((value, second) => [second, value] as const);
  const drawn = path(curve, scaleFor([curve], 3), box).match(/[\d.]+ [\d.]+/g) ?? [];
  const heights = drawn.map((pair) => Number(pair.split(" ")[1]));
  const highest = 50 - (3.6 / 4.05) * 50;
  expect(drawn).toHaveLength(1 + 3 * 5);
  expect(Math.min(...heights)).toBeCloseTo(highest, 1);
});

test("a wild curve is cut at the edge instead of flattening the others", () => {
  const scale = scaleFor([[[0, 0] as const, [10, 30] as const]], 3);
  expect(path([[10, 30]], scale, box)).toBe("M100.0 0.0");
});

test("an output that is to stay at zero is drawn around the middle, as far as the first flight strays", () => {
  const first = [
    [0, 0.1],
    [10, -0.2],
  ] as const;
  const scale = scaleFor([first, [[5, 9]]], 0);
  expect(scale.y[0]).toBeCloseTo(-0.22, 9);
  expect(scale.y[1]).toBeCloseTo(0.22, 9);
  expect(path([[10, 0]], scale, box)).toBe("M100.0 25.0");
  expect(scaleFor([], 0).y).toEqual([-1.1, 1.1]);
});

test("no curve gives an empty path", () => {
  expect(path([], scaleFor([], 3), box)).toBe("");
});
