import { expect, test } from "vitest";
import { campaignStateLabel } from "./states";

const VEHICLE = { can_fly: true, state: "ready" } as const;
const READY = { state: "ready", outcome: null, verdict: null, vehicle: VEHICLE } as const;
const DECIDING = { ...READY, state: "deciding" } as const;
const CONVERGED = { ...READY, state: "finished", outcome: "converged", verdict: "better" } as const;

test("a campaign on a real vehicle is headed by what comes next, not as ready to fly before its rehearsal", () => {
  expect(campaignStateLabel({ ...READY, rehearsal: "missing" }).word).toBe("Rehearsal required");
  expect(campaignStateLabel({ ...DECIDING, rehearsal: "under way" }).word).toBe("Rehearsal in progress");
  expect(campaignStateLabel({ ...READY, rehearsal: "failed" }).word).toBe("Rehearsal failed");
  expect(campaignStateLabel({ ...READY, rehearsal: "passed" }).word).toBe("Not flown yet");
  expect(campaignStateLabel(READY).word).toBe("Not flown yet");
  expect(campaignStateLabel({ ...READY, vehicle: { ...VEHICLE, can_fly: false } }).word).toBe("Ready");
  expect(campaignStateLabel({ ...DECIDING, hasPassed: true }).word).toBe("Rehearsal passed");
  expect(campaignStateLabel({ ...READY, state: "draft", rehearsal: "missing" }).word).toBe("Preparing");
  expect(campaignStateLabel({ ...CONVERGED, rehearsal: "missing" }).word).toBe("Converged");
});

test("a campaign whose vehicle is quarantined waits for its release, whatever else it waits for", () => {
  const vehicle = { ...VEHICLE, state: "quarantined" } as const;
  expect(campaignStateLabel({ ...READY, vehicle }).word).toBe("Vehicle quarantined");
  expect(campaignStateLabel({ ...DECIDING, vehicle, rehearsal: "under way" }).word).toBe("Vehicle quarantined");
  expect(campaignStateLabel({ ...DECIDING, vehicle, state: "flying" }).word).toBe("In flight");
  expect(campaignStateLabel({ ...CONVERGED, vehicle }).word).toBe("Converged");
});

test("a campaign that ended with its first gains as the best is not said to have converged", () => {
  expect(campaignStateLabel({ ...CONVERGED, verdict: null }).word).toBe("No better gains found");
});
