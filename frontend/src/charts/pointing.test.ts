import { expect, test } from "vitest";
import { onPointed, pointAt } from "./pointing";

test("whoever shows flights is told once which one is pointed at, until it no longer cares", () => {
  const told: (number | null)[] = [];
  const stop = onPointed((flight) => told.push(flight));
  pointAt(3);
  pointAt(3);
  pointAt(null);
  stop();
  pointAt(4);
  pointAt(null);
  expect(told).toEqual([3, null]);
});
