import { expect, test } from "vitest";
import {
  type Aged,
  aged,
  ageText,
  before,
  heldGains,
  isAbortStep,
  isDisarmed,
  isDown,
  type LastHeard,
  linkText,
  lowBattery,
  messageText,
  secondsBetween,
  statusFrom,
  stepWord,
} from "./vehicleStatus";

const line = JSON.stringify({
  type: "vehicle",
  vehicle_id: 3,
  state: "connected",
  at: "2026-05-04T10:00:00Z",
  step: "record",
  packet_age_s: 0.1,
  heartbeat_age_s: 0.4,
  armed: true,
  mode: "NAV",
  altitude_m: 2.9,
  climb_rate_m_s: 0.2,
  battery_v: 11.4,
  position_hz: 51.2,
  lost_share: 0,
  held: { kp: 283, ki: 13, kd: 82 },
  said: "",
  trouble: "",
  concern: "",
});

function heard(change: Record<string, unknown> = {}): LastHeard {
  const status = statusFrom(JSON.stringify({ ...(JSON.parse(line) as object), ...change }));
  if (status === null) throw new Error("the line above is a status");
  return { status, heardAt: { wallMs: 50_000, steadyMs: 1_000 } };
}

const after = (seconds: number) => ({ wallMs: 50_000 + 1000 * seconds, steadyMs: 1_000 + 1000 * seconds });

test("a status is read with its gains and its units", () => {
  const { status } = heard();
  expect([status.vehicleId, status.step, status.altitudeM, status.batteryV]).toEqual([3, "record", 2.9, 11.4]);
  expect(status.held).toEqual({ kp: 283, ki: 13, kd: 82 });
  expect(stepWord(status.step)).toBe("In flight");
});

test("the age counts on while nothing comes, and after two seconds nothing is current", () => {
  const soon = aged(heard(), after(1));
  expect([soon.linkAgeS, soon.isCurrent, linkText(soon)]).toEqual([1.1, true, "1.1 s"]);
  const late = aged(heard(), after(2));
  expect([late.isCurrent, linkText(late)]).toEqual([false, "no data for 2.1 s"]);
  expect(linkText(aged(heard(), after(200)))).toBe("no data for 3 min");
});

test("the vehicle's last message has its age", () => {
  expect(messageText(aged(heard(), after(0)))).toBeNull();
  const failed = heard({ said: "Preflight Fail: Compass", said_age_s: 29 });
  expect(messageText(aged(failed, after(3)))).toBe("Vehicle message, 32 s ago: Preflight Fail: Compass");
  expect(messageText(aged(heard({ said: "Armed" }), after(3)))).toBe("Vehicle message: Armed");
});

test("a status that is told once more is as old as it was said, not as it was told", () => {
  const { status } = heard({ age_s: 1.95 });
  const now = after(0);
  const replayed = aged({ status, heardAt: before(now, status.ageS) }, now);
  expect([replayed.linkAgeS, replayed.isCurrent]).toEqual([2.05, false]);
});

test("news that come while the vehicle itself is silent do not make it current", () => {
  const silent = aged(heard({ packet_age_s: 7 }), after(0));
  expect([silent.isCurrent, linkText(silent)]).toEqual([false, "no data for 7.0 s"]);
});

test("a vehicle that is gone or being sought is not current, however new the news", () => {
  expect(aged(heard({ state: "gone" }), after(0)).isCurrent).toBe(false);
  expect(linkText(aged(heard({ state: "gone", packet_age_s: 8.2 }), after(0)))).toBe("link lost for 8.2 s");
  expect(linkText(aged(heard({ state: "gone", packet_age_s: null }), after(0)))).toBe("link lost");
  expect(linkText(aged(heard({ state: "connecting", packet_age_s: null }), after(0)))).toBe("connecting");
  const still = aged(heard({ state: "not answering" }), after(0));
  expect([still.isCurrent, linkText(still)]).toEqual([false, "commands blocked"]);
  expect(linkText(null)).toBe("no data");
  expect(ageText(null)).toBe("no data");
});

test("a clock that was set back, or that slept, does not make old news new", () => {
  const from = { wallMs: 50_000, steadyMs: 1_000 };
  expect(secondsBetween(from, { wallMs: 10_000, steadyMs: 9_000 })).toBe(8);
  expect(secondsBetween(from, { wallMs: 60_000, steadyMs: 1_200 })).toBe(10);
  expect(secondsBetween(from, { wallMs: 49_000, steadyMs: 900 })).toBe(0);
});

test("what is not known stays unknown, and a line that is no status is left alone", () => {
  const { status } = heard({ altitude_m: null, armed: null, held: {}, battery_v: "full" });
  expect([status.altitudeM, status.armed, status.batteryV, status.held]).toEqual([null, null, null, {}]);
  expect(statusFrom('{"type":"vehicle","vehicle_id":3,"state":"asleep"}')).toBeNull();
  expect(statusFrom("null")).toBeNull();
});

test("gains that a connected vehicle has not reported since it restarted are not those read before", () => {
  const now = after(0.1);
  const stored = { state: "ready", held: { kp: 1 } } as const;
  expect(heldGains(stored, aged(heard(), now))).toEqual({ kp: 283, ki: 13, kd: 82 });
  expect(heldGains(stored, aged(heard({ held: {} }), now))).toEqual({});
  expect(heldGains(stored, null)).toEqual({ kp: 1 });
  expect(heldGains({ ...stored, state: "disconnected" }, aged(heard({ held: {} }), now))).toEqual({ kp: 1 });
  expect(heldGains({ ...stored, held: null }, null)).toEqual({});
  expect(heldGains({ ...stored, held: null }, aged(heard({ state: "gone" }), now))).toEqual({});
});

test("a vehicle is disarmed only while it says so", () => {
  const at = (armed: boolean | null, ageS = 0.1) => isDisarmed(aged(heard({ armed }), after(ageS)));
  expect([at(false), at(false, 10), at(true), at(null), isDisarmed(null)]).toEqual([true, false, false, false, false]);
});

test("a battery below the vehicle's minimum is low", () => {
  const vehicle = { options: { min_battery_v: 10.5 } };
  expect(lowBattery(vehicle, 9)).toBe("below 10.5 V");
  expect([lowBattery(vehicle, 10.5), lowBattery(vehicle, null), lowBattery({ options: {} }, 9)]).toEqual(["", "", ""]);
});

test("an aborted flight and one whose link is lost end before their record is complete", () => {
  const steps = ["take-off", "record", "land", "abort-land", "link lost", undefined];
  expect(steps.filter(isAbortStep)).toEqual(["abort-land", "link lost"]);
});

test("ABORT stays until the motors are known to be off", () => {
  const at = (step: string, isCurrent = true, hasSamples = true): boolean =>
    isDown({ status: { step }, isCurrent } as Aged, hasSamples);
  expect(["record", "land", "abort-land", "link lost", "disarm", "restore"].map((step) => at(step))).toEqual([
    ...Array(5).fill(false),
    true,
  ]);
  expect([at("restore", false), isDown(null, true)]).toEqual([false, false]);
  expect([at("idle"), at("idle", true, false)]).toEqual([true, false]);
});
