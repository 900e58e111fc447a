import { expect, test } from "vitest";
import { campaignWords } from "./states";

test("a campaign on a real vehicle is headed by what comes next, not as ready to fly before its rehearsal", () => {
  expect(campaignWords("ready", null, "missing").word).toBe("To be rehearsed first");
  expect(campaignWords("deciding", null, "under way").word).toBe("Being rehearsed");
  expect(campaignWords("ready", null, "failed").word).toBe("Rehearsal failed");
  expect(campaignWords("ready", null, "passed").word).toBe("Ready to fly");
  expect(campaignWords("ready", null).word).toBe("Ready to fly");
  expect(campaignWords("draft", null, "missing").word).toBe("Preparing");
  expect(campaignWords("finished", "converged", "missing").word).toBe("Converged");
});
