import { expect, test } from "vitest";
import type { Trial } from "../../api/types";
import type { Loss, Readiness } from "../../live/readiness";
import { aged, statusFrom } from "../../live/vehicleStatus";
import {
  areReadBackSince,
  flyStateLabel,
  flyStep,
  gainsShown,
  gainTicks,
  isAirborneStep,
  isToldByVehicle,
  leftGainsText,
  secondsLeft,
} from "./flyScreen";

type Flight = NonNullable<Trial["flight"]>;

const flight: Flight = {
  id: 1,
  state: "running",
  mode: "stage",
  take_off_at: null,
  standing_down: "",
  problem: "",
  end: null,
  battery: "",
  battery_v_before: null,
  battery_v_after: null,
  safe_gains_restored: null,
};

function statusAt(step: string, ageS: number) {
  const status = statusFrom(JSON.stringify({ vehicle_id: 1, state: "connected", step, packet_age_s: ageS }));
  if (status === null) throw new Error("that is a status");
  const now = { wallMs: 0, steadyMs: 0 };
  return aged({ status, heardAt: now }, now);
}

test("a trial is planned, staged, flown and judged; the stream may run ahead of the record", () => {
  expect(flyStep({ state: "planned", flight: null }, null)).toBe("plan");
  expect(flyStep({ state: "planned", flight: { ...flight, state: "failed" } }, null)).toBe("plan");
  expect(flyStep({ state: "planned", flight }, "staging")).toBe("staging");
  expect(flyStep({ state: "planned", flight }, "flying")).toBe("flying");
  expect(flyStep({ state: "staged", flight }, "staged")).toBe("staged");
  expect(flyStep({ state: "staged", flight: { ...flight, standing_down: "unstaged" } }, "staged")).toBe("unstaging");
  expect(flyStep({ state: "staged", flight: { ...flight, take_off_at: "2026-05-04T10:00:00Z" } }, null)).toBe("flying");
  expect(flyStep({ state: "captured", flight }, "ended")).toBe("judge");
  expect(flyStep({ state: "valid", flight }, "ended")).toBe("over");
});

const AROUND = { quarantined: false, readiness: null };

/** The label in flight, with the vehicle at that step. */
function inFlight(
  status: ReturnType<typeof statusAt> | null,
  around: Partial<Parameters<typeof flyStateLabel>[3]> = {},
) {
  return flyStateLabel({ state: "flying", flight }, "flying", status, { ...AROUND, ...around });
}

test("the word in flight is the vehicle's own step, and a silent vehicle is never in flight", () => {
  expect(inFlight(statusAt("record", 0.1))).toEqual({ word: "In flight", tone: "busy" });
  expect(inFlight(statusAt("abort-land", 0.1)).tone).toBe("bad");
  expect(inFlight(statusAt("record", 4)).word).toBe("Link lost");
  expect(inFlight(null).word).toBe("In flight");
  expect(inFlight(statusAt("idle", 0.1), { quarantined: true }).word).toBe("Quarantined");
  expect(flyStateLabel({ state: "lost", flight }, "judge", null, AROUND).word).toBe("Lost");
});

test("a landing after a lost link names the loss, not an abort that nobody asked for", () => {
  const words = [false, true].map((hasLostLink) => inFlight(statusAt("abort-land", 0.1), { hasLostLink }).word);
  expect(words).toEqual(["Aborted, landing", "Landing after link loss"]);
});

test("after touchdown it restores the safe gains, until the record is stored; it does not start again", () => {
  const words = [false, true].map((hasFlown) => inFlight(statusAt("idle", 0.1), { hasFlown }).word);
  expect(words).toEqual(["Starting", "Landed, restoring safe gains"]);
});

test("a vehicle that refuses to arm has not been in the air", () => {
  const steps = ["idle", "arm", "take-off", "record", "land", "abort-land", "disarm", undefined];
  expect(steps.filter(isAirborneStep)).toEqual(["take-off", "record", "land", "abort-land"]);
});

test("without the worker it is not known whether the link is lost", () => {
  const readiness = { steps: [], lost: [], losses: [{ kind: "worker away", what: "", way_on: "" }], is_ready: false };
  expect(inFlight(statusAt("record", 4), { readiness: readiness as Readiness })).toEqual({
    word: "Worker not responding",
    tone: "bad",
  });
});

test("a staged vehicle is ready only while its readiness holds", () => {
  const staged = { state: "staged", flight } as const;
  const label = (...kinds: Loss["kind"][]) => {
    const losses = kinds.map((kind) => ({ kind, what: "", way_on: "" }));
    const readiness = { steps: [], lost: [], losses, is_ready: kinds.length === 0 };
    return flyStateLabel(staged, "staged", null, { quarantined: false, readiness }).word;
  };
  expect([label(), label("link silent"), label("control ended"), label("controlled by other")]).toEqual([
    "Staged, ready to fly",
    "Not ready to fly",
    "Staged",
    "Staged",
  ]);
  const unknown = flyStateLabel(staged, "staged", null, { quarantined: false, readiness: null });
  expect(unknown.word).toBe("Checking readiness");
});

test("a gain is ticked only when the vehicle holds exactly what it was asked to", () => {
  const [kp, ki, kd] = gainTicks({ kp: 283, ki: 13, kd: 82 }, null, { kp: 283, ki: 20 });
  expect([kp?.confirmed, ki?.confirmed, kd?.confirmed]).toEqual([true, false, false]);
  expect([ki?.held, kd?.held]).toEqual([20, null]);
  expect(gainTicks({ kp: 283 }, { kp: 283 }, { kp: 1 })[0]?.confirmed).toBe(true);
});

test("gains read back for a flight are told of the vehicle only while it has them", () => {
  const onVehicle = { isHeld: true, readBack: { kp: 283 }, reported: { kp: 300 } };
  expect(gainsShown("plan", onVehicle)).toEqual({ readBack: null, held: { kp: 300 }, areSet: false });
  expect(gainsShown("staged", onVehicle)).toEqual({ readBack: { kp: 283 }, held: { kp: 300 }, areSet: true });
  expect(gainsShown("staged", { ...onVehicle, isHeld: false }).readBack).toBeNull();
  expect(gainsShown("flying", onVehicle)).toEqual({ readBack: null, held: { kp: 300 }, areSet: true });
  expect(gainsShown("flying", { ...onVehicle, reported: {} }).readBack).toEqual({ kp: 283 });
  expect(gainsShown("unstaging", onVehicle)).toEqual({ readBack: null, held: { kp: 300 }, areSet: false });
  expect(gainsShown("judge", onVehicle)).toEqual({ readBack: null, held: {}, areSet: false });
});

test("safe gains count as read back only after the lift-off", () => {
  const trial = { flown_at: "2026-05-04T10:00:00Z" };
  const vehicle = { held: { kp: 4 }, held_at: "2026-05-04T10:02:00Z", safe_gains: { kp: 4 } };
  expect(areReadBackSince(trial, vehicle)).toBe(true);
  expect(areReadBackSince(trial, { ...vehicle, held_at: "2026-05-04T09:59:00Z" })).toBe(false);
  expect(areReadBackSince(trial, { ...vehicle, held: { kp: 5 } })).toBe(false);
  expect(areReadBackSince(trial, { ...vehicle, held: null })).toBe(false);
});

test("the countdown ends with the record", () => {
  expect([secondsLeft(12.5, 30), secondsLeft(31, 30), secondsLeft(undefined, 30)]).toEqual([17.5, 0, null]);
  expect(secondsLeft(1, null)).toBeNull();
});

test("a flight that a pilot took over left its own gains on the vehicle", () => {
  const left = (gains_left: "safe" | "other" | "flight" | "unknown") => leftGainsText({ end: { gains_left } });
  expect(left("flight")).toContain("left with the flight's gains");
  expect(left("unknown")).toContain("not known");
  expect(left("other")).toContain("not on the vehicle");
  expect(leftGainsText({ end: null })).toContain("not known");
});

test("how a flight ended is not repeated beside the quarantine that it led to", () => {
  const trial = (failure: "F6" | "F8", given_reason = "") => ({ given_reason, end: { failure } });
  expect(isToldByVehicle(trial("F8"), { state: "quarantined" })).toBe(true);
  expect(isToldByVehicle(trial("F8"), { state: "ready" })).toBe(false);
  expect(isToldByVehicle(trial("F8", "gust"), { state: "quarantined" })).toBe(false);
  expect(isToldByVehicle(trial("F6"), { state: "quarantined" })).toBe(false);
});
