/** How a connected vehicle is, as the stream last said, and how old that is by now. */

export type LinkState = "connecting" | "connected" | "gone" | "not answering";

export interface VehicleStatus {
  vehicleId: number;
  state: LinkState;
  /** UTC, when it was said. */
  at: string;
  /** Seconds since it was said, when the stream told it: of what a tab that joins late is told once more. */
  ageS: number;
  step: string;
  /** Seconds since the last packet, when it was said. */
  packetAgeS: number | null;
  heartbeatAgeS: number | null;
  armed: boolean | null;
  mode: string;
  altitudeM: number | null;
  climbRateMS: number | null;
  batteryV: number | null;
  positionHz: number | null;
  lostShare: number | null;
  /** Gains as last read back; empty when none were. */
  held: Readonly<Record<string, number>>;
  said: string;
  trouble: string;
  /** Why it may only be observed; empty when it may fly. */
  concern: string;
}

/** Two clocks: one goes on while a tablet sleeps, the other cannot be set back. */
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
  /** Seconds since the vehicle was last heard; null when it never was. */
  linkAgeS: number | null;
  /** Seconds since the status came. */
  statusAgeS: number;
  /** Whether the readings may be shown as what is so now. */
  isCurrent: boolean;
}

export const CURRENT_S = 2;

/** The moment so many seconds before `now`: when that was news which is told only now. */
export function before(now: Moment, ageS: number): Moment {
  return { wallMs: now.wallMs - 1000 * ageS, steadyMs: now.steadyMs - 1000 * ageS };
}

/** The larger of what both clocks say: a clock set back or asleep must not make old news look new. */
export function secondsBetween(from: Moment, to: Moment): number {
  return Math.max(0, to.wallMs - from.wallMs, to.steadyMs - from.steadyMs) / 1000;
}

/** The status with its ages counted on to `now`. */
export function aged({ status, heardAt }: LastHeard, now: Moment): Aged {
  const statusAgeS = secondsBetween(heardAt, now);
  const linkAgeS = status.packetAgeS === null ? null : status.packetAgeS + statusAgeS;
  const isCurrent = status.state === "connected" && linkAgeS !== null && linkAgeS <= CURRENT_S;
  return { status, linkAgeS, statusAgeS, isCurrent };
}

/** `0.1 s` while it is heard; whole seconds and minutes once it is not. */
export function ageText(ageS: number | null): string {
  if (ageS === null) return "never heard";
  if (ageS < 10) return `${ageS.toFixed(1)} s`;
  if (ageS < 120) return `${Math.floor(ageS)} s`;
  return `${Math.floor(ageS / 60)} min`;
}

/** What the link is like, in few words: its age, or what became of it. */
export function linkText(one: Aged | null): string {
  if (one === null) return "no news of it";
  switch (one.status.state) {
    case "connecting":
      return "connecting";
    case "gone":
      return "link gone";
    case "not answering":
      return "its process does not answer";
    case "connected":
      return one.isCurrent || one.linkAgeS === null ? ageText(one.linkAgeS) : `silent for ${ageText(one.linkAgeS)}`;
  }
}

const STEPS: Readonly<Record<string, string>> = {
  idle: "On the ground",
  arm: "Arming",
  "take-off": "Taking off",
  record: "Recording",
  land: "Landing",
  "abort-land": "Aborted, landing",
  "link lost": "Link lost",
  disarm: "Disarming",
  restore: "Restoring safe gains",
  quarantined: "Quarantined",
  observing: "Only observed",
};

/** The step of a trial as a person says it. */
export function stepWord(step: string): string {
  return STEPS[step] ?? step;
}

function number(value: unknown): number | null {
  return typeof value === "number" && Number.isFinite(value) ? value : null;
}

function text(value: unknown): string {
  return typeof value === "string" ? value : "";
}

function gains(value: unknown): Record<string, number> {
  if (typeof value !== "object" || value === null) return {};
  return Object.fromEntries(
    Object.entries(value).filter((entry): entry is [string, number] => number(entry[1]) !== null),
  );
}

const LINKS: readonly LinkState[] = ["connecting", "connected", "gone", "not answering"];

/** The status in one event of the stream; null for anything else. */
export function statusFrom(json: string): VehicleStatus | null {
  const parsed: unknown = JSON.parse(json);
  if (typeof parsed !== "object" || parsed === null) return null;
  const found = parsed as Record<string, unknown>;
  const vehicleId = number(found["vehicle_id"]);
  const state = LINKS.find((one) => one === found["state"]);
  if (vehicleId === null || state === undefined) return null;
  return {
    vehicleId,
    state,
    at: text(found["at"]),
    ageS: number(found["age_s"]) ?? 0,
    step: text(found["step"]),
    packetAgeS: number(found["packet_age_s"]),
    heartbeatAgeS: number(found["heartbeat_age_s"]),
    armed: typeof found["armed"] === "boolean" ? found["armed"] : null,
    mode: text(found["mode"]),
    altitudeM: number(found["altitude_m"]),
    climbRateMS: number(found["climb_rate_m_s"]),
    batteryV: number(found["battery_v"]),
    positionHz: number(found["position_hz"]),
    lostShare: number(found["lost_share"]),
    held: gains(found["held"]),
    said: text(found["said"]),
    trouble: text(found["trouble"]),
    concern: text(found["concern"]),
  };
}
