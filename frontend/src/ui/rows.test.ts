import { expect, test } from "vitest";
import { lastRows } from "./rows";

test("a long table shows its last rows and, before them, the ones that matter", () => {
  const rows = [1, 2, 3, 4, 5, 6];
  expect(lastRows(rows, 2, (row) => row === 3)).toEqual([3, 5, 6]);
  expect(lastRows(rows, 6, () => false)).toBe(rows);
});
