/** What the event stream says, kept outside of React: the connection, the flights under way, and how vehicles are. */

import { useEffect, useMemo, useState, useSyncExternalStore } from "react";
import { Store } from "../api/store";
import type { News } from "./speech";
import { begun, extended, type LiveFlight, type Telemetry, underWay, withFlight } from "./telemetry";
import {
  type Aged,
  aged,
  before,
  CURRENT_S,
  type LastHeard,
  type Moment,
  secondsBetween,
  type VehicleStatus,
} from "./vehicleStatus";

export interface Connection {
  state: "connecting" | "live" | "away";
  worker: boolean;
  /** When the server was last heard, as it stood on this machine's clock; null before the first time. */
  heardAt: string | null;
}

const connection = new Store<Connection>({ state: "connecting", worker: true, heardAt: null });
const flights = new Store<ReadonlyMap<number, LiveFlight>>(new Map());
const vehicles = new Store<ReadonlyMap<number, LastHeard>>(new Map());

export function setConnection(change: Partial<Connection>): void {
  const next = { ...connection.get(), ...change };
  if (next.state !== connection.get().state || next.worker !== connection.get().worker) connection.set(next);
}

/** The stream is lost, or let go: nothing on the page may pass for what is so now. */
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

/** For drawing outside of React: called on every message, returns the function that ends it. */
export function onLive(trialId: number, draw: (flight: LiveFlight) => void): () => void {
  const tell = (): void => {
    const flight = liveNow(trialId);
    if (flight !== null) draw(flight);
  };
  tell();
  return flights.subscribe(tell);
}

const TICK_MS = 250;

/** Now, again and again, so that ages count up while nothing comes. */
function useMoment(): Moment {
  const [now, setNow] = useState(momentNow);
  useEffect(() => {
    const ticking = setInterval(() => setNow(momentNow()), TICK_MS);
    return () => clearInterval(ticking);
  }, []);
  return now;
}

/** How the vehicle is and how old that is, counting on; null while the stream has said nothing of it. */
export function useVehicleStatus(vehicleId: number | null): Aged | null {
  const heard = useSyncExternalStore(vehicles.subscribe, () =>
    vehicleId === null ? null : (vehicles.get().get(vehicleId) ?? null),
  );
  const now = useMoment();
  return useMemo(() => (heard === null ? null : aged(heard, now)), [heard, now]);
}

/** For what speaks of the news: called with everything known, now and whenever any of it changes. Returns the end. */
export function onNews(tell: (news: News) => void): () => void {
  const tellNow = (): void => tell({ state: connection.get().state, flights: flights.get(), vehicles: vehicles.get() });
  tellNow();
  const ends = [connection, flights, vehicles].map((store) => store.subscribe(tellNow));
  return () => {
    for (const end of ends) end();
  };
}

/** Whether the readings of a flight under way may be shown as what is so now. */
export function useIsCurrent(live: LiveFlight | null): boolean {
  const { state, worker } = useConnection();
  const now = useMoment();
  if (live === null || live.heardAt === null) return true;
  return state === "live" && worker && secondsBetween(live.heardAt, now) <= CURRENT_S;
}
