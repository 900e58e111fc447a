/** Telemetry of flights under way, as it came over the stream. */

import type { Moment } from "./vehicleStatus";

export interface LiveFlight {
  campaignId: number;
  trialId: number;
  timeS: number[];
  /** The scored channel: its name, and its value at each of `timeS`. */
  channel: string;
  measured: number[];
  thrust: number | null;
  batteryV: number | null;
  errorSoFar: number | null;
  phase: string;
  /** When the stream last spoke of it; null before. */
  heardAt: Moment | null;
}

export interface Telemetry {
  campaign_id: number;
  trial_id: number;
  time_s: number;
  /** What each row holds: the seconds first, then the scored channel, then whatever else is worth watching. */
  columns: string[];
  samples: number[][];
  error_so_far: number | null;
  /** How long ago it was said, in seconds; of what a tab that joins late is told once more. */
  age_s: number;
}

export function begun(campaignId: number, trialId: number): LiveFlight {
  return {
    campaignId,
    trialId,
    timeS: [],
    channel: "altitude_m",
    measured: [],
    thrust: null,
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
  return {
    ...flight,
    timeS,
    channel: news.columns[1] ?? flight.channel,
    measured,
    thrust: latest("thrust") ?? flight.thrust,
    batteryV: latest("battery_v") ?? flight.batteryV,
    errorSoFar: news.error_so_far ?? flight.errorSoFar,
  };
}

/** How a channel is read out: what it is called, its unit, and the digits that matter. */
const CHANNELS: Record<string, { title: string; unit: string; digits: number }> = {
  altitude_m: { title: "Altitude", unit: "m", digits: 2 },
  pitch_error_rad: { title: "Pitch error", unit: "rad", digits: 3 },
};

export function readingOf(channel: string): { title: string; unit: string; digits: number } {
  return CHANNELS[channel] ?? { title: channel, unit: "", digits: 3 };
}

/** On the ground: over, or waiting with the gains set for its operator's word. */
const DOWN = new Set(["staged", "landed", "ended"]);

/** The flights that the stream last spoke of as under way, from the moment that their gains are set. */
export function underWay(flights: ReadonlyMap<number, LiveFlight>): LiveFlight[] {
  return [...flights.values()].filter(({ phase }) => !DOWN.has(phase));
}

const KEPT = 8;

/** The flights with this one put in; of many, only those that were heard of last are kept. */
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
