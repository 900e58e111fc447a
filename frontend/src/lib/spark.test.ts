import { expect, test } from "vitest";
import { path, scaleFor } from "./spark";

const box = { width: 100, height: 50 };

test("a curve is drawn from the lower left, its set point below the upper edge", () => {
  const curve = [
    [0, 0],
    [5, 3],
    [10, 3],
  ] as const;
  const scale = scaleFor([curve], 3);
  expect(scale).toEqual({ x: [0, 10], y: [0, 4.050000000000001] });
  expect(path(curve, scale, box)).toBe("M0.0 50.0L50.0 13.0L100.0 13.0");
});

test("a wild curve is cut at the edge instead of flattening the others", () => {
  const scale = scaleFor([[[0, 0] as const, [10, 30] as const]], 3);
  expect(path([[10, 30]], scale, box)).toBe("M100.0 0.0");
});

test("no curve gives an empty path", () => {
  expect(path([], scaleFor([], 3), box)).toBe("");
});
