import { expect, test } from "vitest";
import type { CampaignSummary } from "../../api/types";
import { progress, STATES } from "./campaignList";

const summary = (
  best: number | null,
  first: number | null,
  flights: number,
  verdict: CampaignSummary["verdict"] = null,
): CampaignSummary =>
  ({
    best: best === null ? null : { error: best, mean: best },
    first_error: first,
    flights,
    verdict,
  }) as unknown as CampaignSummary;

test("progress is told against the first gains", () => {
  expect(progress(summary(0.0933, 0.3267, 5, "better"))).toBe("71\u00a0% below the first gains");
  expect(progress(summary(0.3267, 0.3267, 3))).toBe("no improvement yet");
});

test("a difference within the noise is no progress that could be claimed", () => {
  expect(progress(summary(0.32, 0.3267, 5, "unresolved"))).toBe("unresolved vs. the first gains");
});

test("before anybody knows how much flights scatter, a difference may be chance", () => {
  expect(progress(summary(0.0933, 0.3267, 2, "not known yet"))).toBe(
    "71\u00a0% below the first gains, verdict not known yet",
  );
});

test("one flight is no progress yet", () => {
  expect(progress(summary(0.3267, 0.3267, 1))).toBeNull();
  expect(progress(summary(null, null, 0))).toBeNull();
});

test("archived campaigns are shown only when asked for", () => {
  expect(STATES.All).not.toContain("archived");
  expect(STATES.Archived).toEqual(["archived"]);
});
