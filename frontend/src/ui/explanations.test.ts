import { expect, test } from "vitest";
import { EXPLANATIONS } from "./explanations";

test("every question is one, asked once, and its answer is short enough to be read beside a drone", () => {
  const all = Object.values(EXPLANATIONS).map(([question, ...answer]) => ({ question, answer }));
  expect(new Set(all.map(({ question }) => question)).size).toBe(all.length);
  expect(all.filter(({ question }) => !question.endsWith("?"))).toEqual([]);
  expect(
    all.filter(({ answer }) => answer.join(" ").length > 420 || answer.some((said) => !said.endsWith("."))),
  ).toEqual([]);
});
