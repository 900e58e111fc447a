/** Telemetry of flights under way, as it came over the stream. */

export interface LiveFlight {
  campaignId: number;
  trialId: number;
  timeS: number[];
  altitudeM: number[];
  thrust: number | null;
  batteryV: number | null;
  errorSoFar: number | null;
  phase: string;
}

export interface Telemetry {
  campaign_id: number;
  trial_id: number;
  time_s: number;
  /** Rows of seconds, altitude, climb rate, set point, reference, share of full thrust, battery volts. */
  samples: number[][];
  error_so_far: number | null;
}

export function begun(campaignId: number, trialId: number): LiveFlight {
  return {
    campaignId,
    trialId,
    timeS: [],
    altitudeM: [],
    thrust: null,
    batteryV: null,
    errorSoFar: null,
    phase: "flying",
  };
}

/** The flight with the new samples; samples not newer than the last (sent twice after a reconnect) are dropped. */
export function extended(flight: LiveFlight, news: Telemetry): LiveFlight {
  const timeS = [...flight.timeS];
  const altitudeM = [...flight.altitudeM];
  for (const [time, altitude] of news.samples) {
    if (time === undefined || altitude === undefined || time <= (timeS.at(-1) ?? Number.NEGATIVE_INFINITY)) continue;
    timeS.push(time);
    altitudeM.push(altitude);
  }
  const last = news.samples.at(-1);
  return {
    ...flight,
    timeS,
    altitudeM,
    thrust: last?.[5] ?? flight.thrust,
    batteryV: last?.[6] ?? flight.batteryV,
    errorSoFar: news.error_so_far ?? flight.errorSoFar,
  };
}

const OVER = new Set(["landed", "ended"]);

/** The flights that the stream last spoke of as under way. */
export function underWay(flights: ReadonlyMap<number, LiveFlight>): LiveFlight[] {
  return [...flights.values()].filter(({ phase }) => !OVER.has(phase));
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
  const { campaign_id, trial_id, time_s, samples, error_so_far } = parsed as Record<string, unknown>;
  if (typeof campaign_id !== "number" || typeof trial_id !== "number" || !Array.isArray(samples)) return null;
  return {
    campaign_id,
    trial_id,
    time_s: typeof time_s === "number" ? time_s : 0,
    samples: samples.filter(isRow),
    error_so_far: typeof error_so_far === "number" ? error_so_far : null,
  };
}
