/** State of the event stream outside of React: connection, flights in progress, vehicle status. */

import { useEffect, useMemo, useState, useSyncExternalStore } from "react";
import { Store } from "../api/store";
import type { News } from "./speech";
import { begun, extended, type LiveFlight, type Telemetry, underWay, withFlight } from "./telemetry";
import {
  type Aged,
  aged,
  before,
  CURRENT_S,
  isAfterRecord,
  type LastHeard,
  type Moment,
  secondsBetween,
  type VehicleStatus,
} from "./vehicleStatus";

export interface Connection {
  state: "connecting" | "live" | "away";
  worker: boolean;
  /** Time of the last event, by this machine's clock; null before the first. */
  heardAt: string | null;
}

const connection = new Store<Connection>({ state: "connecting", worker: true, heardAt: null });
const flights = new Store<ReadonlyMap<number, LiveFlight>>(new Map());
const vehicles = new Store<ReadonlyMap<number, LastHeard>>(new Map());

export function setConnection(change: Partial<Connection>): void {
  const next = { ...connection.get(), ...change };
  if (next.state !== connection.get().state || next.worker !== connection.get().worker) connection.set(next);
}

/** The stream is lost or closed: all data is stale. */
export function setNotLive(state: "connecting" | "away", heardAt: string | null): void {
  if (connection.get().state !== state) connection.set({ ...connection.get(), state, heardAt });
}

export function applyTelemetry(news: Telemetry): void {
  const known = flights.get().get(news.trial_id) ?? begun(news.campaign_id, news.trial_id);
  flights.set(withFlight(flights.get(), { ...extended(known, news), heardAt: before(momentNow(), news.age_s) }));
}

export function applyPhase(campaignId: number, trialId: number, phase: string): void {
  const known = flights.get().get(trialId) ?? begun(campaignId, trialId);
  flights.set(withFlight(flights.get(), { ...known, phase, heardAt: momentNow() }));
}

export function applyStatus(status: VehicleStatus): void {
  vehicles.set(new Map([...vehicles.get(), [status.vehicleId, { status, heardAt: before(momentNow(), status.ageS) }]]));
}

export function momentNow(): Moment {
  return { wallMs: Date.now(), steadyMs: performance.now() };
}

export function useConnection(): Connection {
  return useSyncExternalStore(connection.subscribe, connection.get);
}

/** The live record of one trial; a new object with every message. */
export function useLiveFlight(trialId: number | null): LiveFlight | null {
  return useSyncExternalStore(flights.subscribe, () => liveNow(trialId));
}

export function liveNow(trialId: number | null): LiveFlight | null {
  return trialId === null ? null : (flights.get().get(trialId) ?? null);
}

export function liveFlightsNow(): LiveFlight[] {
  return underWay(flights.get());
}

/** Subscribe for drawing outside of React: called on every message; returns the unsubscribe function. */
export function onLive(trialId: number, draw: (flight: LiveFlight) => void): () => void {
  const tell = (): void => {
    const flight = liveNow(trialId);
    if (flight !== null) draw(flight);
  };
  tell();
  return flights.subscribe(tell);
}

const TICK_MS = 250;

/** The current time, updated regularly so that ages increase without messages. */
export function useMoment(): Moment {
  const [now, setNow] = useState(momentNow);
  useEffect(() => {
    const ticking = setInterval(() => setNow(momentNow()), TICK_MS);
    return () => clearInterval(ticking);
  }, []);
  return now;
}

/** Vehicle status with its increasing age; null until the first one is received. */
export function useVehicleStatus(vehicleId: number | null): Aged | null {
  const heard = useSyncExternalStore(vehicles.subscribe, () =>
    vehicleId === null ? null : (vehicles.get().get(vehicleId) ?? null),
  );
  const now = useMoment();
  return useMemo(() => (heard === null ? null : aged(heard, now)), [heard, now]);
}

/** Subscribe to all state: called now and on every change. Returns the unsubscribe function. */
export function onNews(tell: (news: News) => void): () => void {
  const tellNow = (): void => tell({ state: connection.get().state, flights: flights.get(), vehicles: vehicles.get() });
  tellNow();
  const ends = [connection, flights, vehicles].map((store) => store.subscribe(tellNow));
  return () => {
    for (const end of ends) end();
  };
}

/** Whether the readings of a flight in progress are current. */
export function useIsCurrent(live: LiveFlight | null): boolean {
  const { state, worker } = useConnection();
  const now = useMoment();
  if (live === null || live.heardAt === null) return true;
  return state === "live" && worker && secondsBetween(live.heardAt, now) <= CURRENT_S;
}

/** Whether `outputNow` is current: the samples while they are recorded, else what the vehicle reports. */
export function useIsOutputCurrent(live: LiveFlight | null, status: Aged | null): boolean {
  const isRecordCurrent = useIsCurrent(live);
  return isAfterRecord(status?.status.step) ? status?.isCurrent === true : isRecordCurrent;
}
