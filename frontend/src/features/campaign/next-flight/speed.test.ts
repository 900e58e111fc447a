import { expect, test } from "vitest";
import { speedOf } from "./speed";

test("the speed is ten times life unless somebody chose another", () => {
  expect([speedOf("1"), speedOf("10"), speedOf("max"), speedOf("nonsense")]).toEqual([1, 10, null, 10]);
});
