import { expect, test } from "vitest";
import { paramsOf } from "../../api/compare";
import { chosenIn, withoutRefused } from "./chosenFlights";

test("an address holds the flights in their order, each once, and nothing that is no flight", () => {
  expect(chosenIn(new URLSearchParams("trial=8&trial=3&trial=8&trial=x&trial=-1&campaign=4"))).toEqual([8, 3]);
  expect(chosenIn(paramsOf([8, 3], null))).toEqual([8, 3]);
  expect(paramsOf([8, 3], "4").toString()).toBe("campaign=4&trial=8&trial=3");
});

test("what a refusal names is left out by its place", () => {
  const problem = { status: 422, title: "", detail: "", hint: "", problems: [{ field: "trial.1", reason: "is gone" }] };
  expect(withoutRefused([8, 3, 5], problem)).toEqual([8, 5]);
  expect(withoutRefused([8, 3, 5], null)).toEqual([8, 3, 5]);
});
