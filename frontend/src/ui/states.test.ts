import { expect, test } from "vitest";
import { campaignStateLabel } from "./states";

test("a campaign on a real vehicle is headed by what comes next, not as ready to fly before its rehearsal", () => {
  expect(campaignStateLabel("ready", null, "missing").word).toBe("Rehearsal required");
  expect(campaignStateLabel("deciding", null, "under way").word).toBe("Rehearsal in progress");
  expect(campaignStateLabel("ready", null, "failed").word).toBe("Rehearsal failed");
  expect(campaignStateLabel("ready", null, "passed").word).toBe("Not flown yet");
  expect(campaignStateLabel("ready", null).word).toBe("Not flown yet");
  expect(campaignStateLabel("ready", null, "not needed", false).word).toBe("Ready");
  expect(campaignStateLabel("deciding", null, "not needed", true, true).word).toBe("Rehearsal passed");
  expect(campaignStateLabel("draft", null, "missing").word).toBe("Preparing");
  expect(campaignStateLabel("finished", "converged", "missing").word).toBe("Converged");
});
