import { expect, test } from "vitest";
import { nextOrder, sortedBy, toggled } from "./flightsTable";

const flights = [
  { number: 1, error: 0.3 },
  { number: 2, error: null },
  { number: 3, error: 0.1 },
  { number: 4, error: 0.3 },
];
const numbers = (descending: boolean) =>
  sortedBy(flights, ({ error }) => error, descending).map(({ number }) => number);

test("flights sort by a value, equal ones by their number, and those without one come last both ways", () => {
  expect(numbers(false)).toEqual([3, 1, 4, 2]);
  expect(numbers(true)).toEqual([1, 4, 3, 2]);
  expect(sortedBy(["b", "a"], (text) => text, false)).toEqual(["a", "b"]);
});

test("a title sorts rising, then falling, then by flight number again", () => {
  const rising = nextOrder(null, "error");
  expect(rising).toEqual({ column: "error", descending: false });
  const falling = nextOrder(rising, "error");
  expect(falling).toEqual({ column: "error", descending: true });
  expect(nextOrder(falling, "error")).toBeNull();
  expect(nextOrder(falling, "kp")).toEqual({ column: "kp", descending: false });
});

test("a column is hidden and shown again", () => {
  expect(toggled(["kp"], "ki")).toEqual(["kp", "ki"]);
  expect(toggled(["kp", "ki"], "kp")).toEqual(["ki"]);
});
