import { expect, test } from "vitest";
import type { CampaignSummary } from "../api/types";
import { progress, statesFor } from "./campaigns";

const summary = (best: number | null, first: number | null, flights: number): CampaignSummary =>
  ({ best: best === null ? null : { error: best }, first_error: first, flights }) as unknown as CampaignSummary;

test("progress is told against the first flight", () => {
  expect(progress(summary(0.0933, 0.3267, 5))).toBe("71 % below the first");
  expect(progress(summary(0.3267, 0.3267, 3))).toBe("none better yet");
});

test("one flight is no progress yet", () => {
  expect(progress(summary(0.3267, 0.3267, 1))).toBeNull();
  expect(progress(summary(null, null, 0))).toBeNull();
});

test("archived campaigns are shown only when asked for", () => {
  expect(statesFor("all")).not.toContain("archived");
  expect(statesFor("archived")).toEqual(["archived"]);
});
