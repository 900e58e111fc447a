/** Telemetry of flights in progress, from the event stream. */

import { type Aged, isRecordedStep, type Moment, oneOf } from "./vehicleStatus";

export interface LiveFlight {
  campaignId: number;
  trialId: number;
  timeS: number[];
  /** The scored channel: its name, and its value at each of `timeS`. */
  channel: string;
  measured: number[];
  /** Throttle now, as a share of full; null if the vehicle does not report it. */
  throttle: number | null;
  batteryV: number | null;
  errorSoFar: number | null;
  phase: string;
  /** Time of the last message about it; null before the first. */
  heardAt: Moment | null;
}

export interface Telemetry {
  campaign_id: number;
  trial_id: number;
  time_s: number;
  /** Columns of each row: time in seconds, the scored channel, then other channels. */
  columns: string[];
  samples: number[][];
  error_so_far: number | null;
  /** Age of the message in seconds, for messages repeated to tabs that join late. */
  age_s: number;
}

export function begun(campaignId: number, trialId: number): LiveFlight {
  return {
    campaignId,
    trialId,
    timeS: [],
    channel: "altitude_m",
    measured: [],
    throttle: null,
    batteryV: null,
    errorSoFar: null,
    phase: "flying",
    heardAt: null,
  };
}

/** The flight with the new samples; samples not newer than the last (sent twice after a reconnect) are dropped. */
export function extended(flight: LiveFlight, news: Telemetry): LiveFlight {
  const timeS = [...flight.timeS];
  const measured = [...flight.measured];
  for (const [time, value] of news.samples) {
    if (time === undefined || value === undefined || time <= (timeS.at(-1) ?? Number.NEGATIVE_INFINITY)) continue;
    timeS.push(time);
    measured.push(value);
  }
  const last = news.samples.at(-1);
  const latest = (column: string): number | undefined => last?.[news.columns.indexOf(column)];
  const reported = latest("throttle");
  const throttle = latest("thrust") ?? (reported === undefined ? null : reportedThrottle(reported, timeS, measured));
  return {
    ...flight,
    timeS,
    channel: news.columns[1] ?? flight.channel,
    measured,
    throttle: last === undefined ? flight.throttle : throttle,
    batteryV: latest("battery_v") ?? flight.batteryV,
    errorSoFar: news.error_so_far ?? flight.errorSoFar,
  };
}

const FULL_THROTTLE = 0.995;
const NO_THROTTLE = 0.005;
const AIRBORNE_M = 0.1;

/** A vehicle reports its throttle this seldom: a report of zero may be older than the lift-off. */
const REPORT_S = 4;

/** Reported throttle; null if it is zero and may be from before the lift-off. */
function reportedThrottle(share: number, timeS: readonly number[], measured: readonly number[]): number | null {
  const liftedS = timeS[measured.findIndex((altitude) => altitude > AIRBORNE_M)];
  const isDoubtful = share <= NO_THROTTLE && liftedS !== undefined && (timeS.at(-1) ?? 0) - liftedS <= REPORT_S;
  return isDoubtful ? null : share;
}

/** Whether the throttle is at its maximum, or at zero in the air. */
export function isSaturated({ throttle, measured }: LiveFlight): boolean {
  if (throttle === null) return false;
  return throttle >= FULL_THROTTLE || (throttle <= NO_THROTTLE && (measured.at(-1) ?? 0) > AIRBORNE_M);
}

/** The scored channel now: its last sample while it is recorded, else the altitude that the vehicle reports. */
export function outputNow(live: LiveFlight | null, status: Aged | null): number | null | undefined {
  if (status === null || isRecordedStep(status.status.step)) return live?.measured.at(-1);
  return status.status.altitudeM;
}

/** Throttle of the flight now; null once its samples have ended. */
export function throttleNow(live: LiveFlight, status: Aged | null): number | null {
  return status === null || isRecordedStep(status.status.step) ? live.throttle : null;
}

/** Display of channels: title, unit and decimal places. */
const CHANNELS: Record<string, { title: string; unit: string; digits: number }> = {
  altitude_m: { title: "Altitude", unit: "m", digits: 2 },
  pitch_error_rad: { title: "Pitch error", unit: "rad", digits: 3 },
};

export function readingOf(channel: string): { title: string; unit: string; digits: number } {
  return CHANNELS[channel] ?? { title: channel, unit: "", digits: 3 };
}

/** Whether a flight in this phase is over. */
export const hasLanded = oneOf("landed", "ended");

/** Flights in progress according to the stream, beginning with the staging of their gains. */
export function underWay(flights: ReadonlyMap<number, LiveFlight>): LiveFlight[] {
  return [...flights.values()].filter(({ phase }) => phase !== "staged" && !hasLanded(phase));
}

const KEPT = 8;

/** The flights with this one added; only the most recently updated are kept. */
export function withFlight(flights: ReadonlyMap<number, LiveFlight>, flight: LiveFlight): Map<number, LiveFlight> {
  const others = [...flights].filter(([trialId]) => trialId !== flight.trialId);
  return new Map([...others.slice(1 - KEPT), [flight.trialId, flight]]);
}

function isRow(value: unknown): value is number[] {
  return Array.isArray(value) && value.every((entry) => typeof entry === "number");
}

export function telemetryFrom(json: string): Telemetry | null {
  const parsed: unknown = JSON.parse(json);
  if (typeof parsed !== "object" || parsed === null) return null;
  const { campaign_id, trial_id, time_s, columns, samples, error_so_far, age_s } = parsed as Record<string, unknown>;
  if (typeof campaign_id !== "number" || typeof trial_id !== "number" || !Array.isArray(samples)) return null;
  if (!Array.isArray(columns)) return null;
  return {
    campaign_id,
    trial_id,
    time_s: typeof time_s === "number" ? time_s : 0,
    columns: columns.map(String),
    samples: samples.filter(isRow),
    error_so_far: typeof error_so_far === "number" ? error_so_far : null,
    age_s: typeof age_s === "number" ? age_s : 0,
  };
}
