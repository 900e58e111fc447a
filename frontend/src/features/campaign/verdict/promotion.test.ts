import { expect, test } from "vitest";
import { heldGainsNotice, promotionRefusal } from "./promotion";

test("the best gains become the safe ones only once flights have shown that they are better", () => {
  const drone = { name: "Number 1", safe_gains: { kp: 283 } };
  const winner = { gains: { kp: 400 }, trial_numbers: [2, 3], verdict: "better" as const };
  expect(promotionRefusal(winner, drone)).toBe("");
  expect(promotionRefusal({ ...winner, verdict: "unresolved" }, drone)).toContain("their verdict is “unresolved”");
  expect(promotionRefusal({ ...winner, verdict: null }, drone)).toContain("fly others first");
  expect(promotionRefusal({ ...winner, gains: { kp: 283 } }, drone)).toBe(
    "The best gains are the safe gains of Number 1.",
  );
});

test("after a change of the safe gains it is told what the vehicle holds until they are written to it", () => {
  const identity = { system_id: 31, autopilot: "paparazzi", version: "", uid: "" };
  const gains = { held: { kd: 82, kp: 283 }, safe_gains: { kp: 400, kd: 100 } };
  const vehicle = { name: "Bee", state: "ready", identity, ...gains } as const;
  expect(heldGainsNotice(vehicle)).toBe(
    "Bee still holds [283 82]. The safe gains are written at the next check, restore or flight.",
  );
  expect(heldGainsNotice({ ...vehicle, state: "disconnected" })).toContain("at the next connection");
  expect(heldGainsNotice({ ...vehicle, state: "quarantined" })).toContain("or the vehicle is released");
  expect(heldGainsNotice({ ...vehicle, held: vehicle.safe_gains })).toBe("");
  expect(heldGainsNotice({ ...vehicle, held: null })).toBe("");
});
