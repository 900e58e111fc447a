/** Telemetry of flights under way, as it came over the stream. */

export const CHANNELS = ["time", "altitude", "climb rate", "set point", "reference", "thrust", "battery"] as const;

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
