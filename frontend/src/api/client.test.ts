import { expect, test } from "vitest";
import { randomKey } from "./client";

test("every request gets its own key of 128 bits", () => {
  const keys = new Set(Array.from({ length: 100 }, randomKey));
  expect(keys.size).toBe(100);
  for (const key of keys) expect(key).toMatch(/^[0-9a-f]{32}$/);
});
