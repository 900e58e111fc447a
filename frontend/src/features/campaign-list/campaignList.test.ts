import { expect, test } from "vitest";
import type { CampaignSummary } from "../../api/types";
import { progress, STATES } from "./campaignList";

test.each<
  [says: string, best: number | null, flights: number, verdict: CampaignSummary["verdict"], text: string | null]
>([
  ["progress is told against the first gains", 0.0933, 5, "better", "71\u00a0% below the first gains"],
  ["the first gains themselves are no progress", 0.3267, 3, null, "no improvement yet"],
  [
    "a difference within the noise is no progress that could be claimed",
    0.32,
    5,
    "unresolved",
    "unresolved vs. the first gains",
  ],
  [
    "before anybody knows how much flights scatter, it may be chance",
    0.0933,
    2,
    "not known yet",
    "71\u00a0% below the first gains, verdict not known yet",
  ],
  ["one flight is no progress yet", 0.3267, 1, null, null],
  ["nor is none", null, 0, null, null],
])("%s", (_says, mean, flights, verdict, text) => {
  const summary = { best: mean && { mean }, first_error: 0.3267, flights, verdict };
  expect(progress(summary as unknown as CampaignSummary)).toBe(text);
});

test("archived campaigns are shown only when asked for", () => {
  expect(STATES.All).not.toContain("archived");
  expect(STATES.Archived).toEqual(["archived"]);
});
