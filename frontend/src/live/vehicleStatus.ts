/** Last received status of a connected vehicle, and its age. */

import type { Vehicle } from "../api/types";

const LINKS = ["connecting", "connected", "gone", "not answering"] as const;

type Event = Readonly<Record<string, unknown>>;

function isNumber(value: unknown): value is number {
  return typeof value === "number" && Number.isFinite(value);
}

const number = (field: string) => (event: Event) => (isNumber(event[field]) ? event[field] : null);
const numberOr0 = (field: string) => (event: Event) => (isNumber(event[field]) ? event[field] : 0);
const text = (field: string) => (event: Event) => (typeof event[field] === "string" ? event[field] : "");

/** What a status event of the stream says, field by field. */
const READERS = {
  /** Time of the status, UTC. */
  at: text("at"),
  /** Age of the status when it was received, in seconds, for statuses repeated to tabs that join late. */
  ageS: numberOr0("age_s"),
  step: text("step"),
  /** Seconds since the last packet, at the time of the status. */
  packetAgeS: number("packet_age_s"),
  heartbeatAgeS: number("heartbeat_age_s"),
  armed: ({ armed }: Event) => (typeof armed === "boolean" ? armed : null),
  mode: text("mode"),
  altitudeM: number("altitude_m"),
  climbRateMS: number("climb_rate_m_s"),
  batteryV: number("battery_v"),
  positionHz: number("position_hz"),
  lostShare: number("lost_share"),
  /** Gains as last read back; empty if none were. */
  held: ({ held }: Event): Readonly<Record<string, number>> =>
    Object.fromEntries(Object.entries(held ?? {}).filter(([, value]) => isNumber(value))),
  said: text("said"),
  saidAgeS: number("said_age_s"),
  trouble: text("trouble"),
  /** Reason of the quarantine; empty if it may fly. */
  concern: text("concern"),
  /** How often the vehicle has restarted since the connection was opened. */
  restarts: numberOr0("restarts"),
};

type Readings = { [Name in keyof typeof READERS]: ReturnType<(typeof READERS)[Name]> };

export interface VehicleStatus extends Readings {
  vehicleId: number;
  state: (typeof LINKS)[number];
}

/** Parse a status event of the stream; null if it is not one. */
export function statusFrom(json: string): VehicleStatus | null {
  const event = JSON.parse(json) as Event | null;
  const vehicleId = event?.["vehicle_id"];
  const state = LINKS.find((one) => one === event?.["state"]);
  if (event === null || !isNumber(vehicleId) || state === undefined) return null;
  const readings = Object.entries(READERS).map(([name, read]) => [name, read(event)]);
  return { ...(Object.fromEntries(readings) as Readings), vehicleId, state };
}

/** Two clocks: the wall clock runs while a tablet sleeps, the steady clock cannot be set back. */
export interface Moment {
  wallMs: number;
  steadyMs: number;
}

export interface LastHeard {
  status: VehicleStatus;
  heardAt: Moment;
}

export interface Aged {
  status: VehicleStatus;
  /** Seconds since the last packet from the vehicle; null before the first. */
  linkAgeS: number | null;
  /** Seconds since the status was received. */
  statusAgeS: number;
  /** Whether the readings are current. */
  isCurrent: boolean;
}

export const CURRENT_S = 2;

/** The moment `ageS` seconds before `now`. */
export function before(now: Moment, ageS: number): Moment {
  return { wallMs: now.wallMs - 1000 * ageS, steadyMs: now.steadyMs - 1000 * ageS };
}

/** The larger difference of both clocks: a clock that was set back or slept must not make stale data look current. */
export function secondsBetween(from: Moment, to: Moment): number {
  return Math.max(0, to.wallMs - from.wallMs, to.steadyMs - from.steadyMs) / 1000;
}

/** The status with its ages at `now`. */
export function aged({ status, heardAt }: LastHeard, now: Moment): Aged {
  const statusAgeS = secondsBetween(heardAt, now);
  const linkAgeS = status.packetAgeS === null ? null : status.packetAgeS + statusAgeS;
  const isCurrent = status.state === "connected" && linkAgeS !== null && linkAgeS <= CURRENT_S;
  return { status, linkAgeS, statusAgeS, isCurrent };
}

/**
 * The gains that a vehicle holds: as its link knows them, empty if it does not; without one as last read back, empty if
 * what was read back is not known to hold any more.
 */
export function heldGains(
  { state, held }: Pick<Vehicle, "state" | "held">,
  known: Aged | null,
): Readonly<Record<string, number>> {
  if (state === "disconnected" || known === null || (held === null && !known.isCurrent)) return held ?? {};
  return known.status.held;
}

/** Whether the vehicle was last known to be armed: nothing is written to it and nothing read from it then. */
export function isArmed(known: Aged | null): boolean {
  return known?.status.armed === true;
}

/** Whether the vehicle reports now that its motors are off. */
export function isDisarmed(known: Aged | null): boolean {
  return known?.isCurrent === true && known.status.armed === false;
}

/** `below 10.5 V` for a battery below the vehicle's minimum; else empty. */
export function lowBattery({ options }: Pick<Vehicle, "options">, batteryV: number | null | undefined): string {
  const least = options["min_battery_v"];
  if (!isNumber(least) || batteryV === null || batteryV === undefined || batteryV >= least) return "";
  return `below ${least.toFixed(1)} V`;
}

/** `0.1 s` up to 10 s; then whole seconds and minutes. */
export function ageText(ageS: number | null): string {
  if (ageS === null) return "no data";
  if (ageS < 10) return `${ageS.toFixed(1)} s`;
  if (ageS < 120) return `${Math.floor(ageS)} s`;
  return `${Math.floor(ageS / 60)} min`;
}

/** The vehicle's last status text with its age; null if there is none. */
export function messageText({ status, statusAgeS }: Aged): string | null {
  if (status.said === "") return null;
  const when = status.saidAgeS === null ? "" : `, ${ageText(status.saidAgeS + statusAgeS)} ago`;
  return `Vehicle message${when}: ${status.said}`;
}

/** State of the link as a short text: its age, or why there is no data. */
export function linkText(one: Aged | null): string {
  if (one === null) return "no data";
  switch (one.status.state) {
    case "connecting":
      return "connecting";
    case "gone":
      return one.linkAgeS === null ? "link lost" : `link lost for ${ageText(one.linkAgeS)}`;
    case "not answering":
      return "commands blocked";
    case "connected":
      return one.isCurrent || one.linkAgeS === null ? ageText(one.linkAgeS) : `no data for ${ageText(one.linkAgeS)}`;
  }
}

const STEPS: Readonly<Record<string, string>> = {
  idle: "On the ground",
  preflight: "Preflight checks",
  arm: "Arming",
  "take-off": "Taking off",
  record: "In flight",
  land: "Landing",
  "abort-land": "Aborted, landing",
  "link lost": "Link lost",
  disarm: "Disarming",
  restore: "Restoring safe gains",
  quarantined: "Quarantined",
  observing: "Monitoring only",
};

/** Label of a trial's step. */
export function stepWord(step: string): string {
  return STEPS[step] ?? step;
}

/** Whether a step or phase, undefined where none is known, is one of these. */
export function oneOf(...steps: readonly string[]): (step: string | undefined) => boolean {
  return (step) => step !== undefined && steps.includes(step);
}

/** Whether samples of the flight arrive in this step; in others the vehicle's own messages tell where it is. */
export const isRecordedStep = oneOf("take-off", "record", "abort-land");

/** Whether the record has ended in this step, and the vehicle lands, or has landed. */
export const isAfterRecord = oneOf("land", "disarm", "restore");

/** Whether the vehicle ends the flight before its record is complete. */
export const isAbortStep = oneOf("abort-land", "link lost");

/** Whether the vehicle has landed and disarmed after samples of its flight: there is nothing to abort any more. */
export function isDown(known: Aged | null, hasSamples: boolean): boolean {
  if (known?.isCurrent !== true) return false;
  return known.status.step === "restore" || (hasSamples && known.status.step === "idle");
}
