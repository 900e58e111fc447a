/** The event stream of the tab and its state outside of React: connection, flights in progress, vehicle status. Changes
 * invalidate queries, telemetry feeds the live curves. */

import type { QueryClient } from "@tanstack/react-query";
import { useEffect, useMemo, useState, useSyncExternalStore } from "react";
import { Store } from "../api/store";
import type { News } from "./speech";
import { type Change, changeFrom, createInvalidator, staleQueries } from "./staleQueries";
import { begun, extended, type LiveFlight, type Telemetry, telemetryFrom, underWay, withFlight } from "./telemetry";
import {
  type Aged,
  aged,
  before,
  CURRENT_S,
  isAfterRecord,
  type LastHeard,
  type Moment,
  secondsBetween,
  statusFrom,
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

function setConnection(change: Partial<Connection>): void {
  const next = { ...connection.get(), ...change };
  if (next.state !== connection.get().state || next.worker !== connection.get().worker) connection.set(next);
}

/** The stream is lost or closed: all data is stale. */
function setNotLive(state: "connecting" | "away", heardAt: string | null): void {
  if (connection.get().state !== state) connection.set({ ...connection.get(), state, heardAt });
}

function applyTelemetry(news: Telemetry): void {
  const known = flights.get().get(news.trial_id) ?? begun(news.campaign_id, news.trial_id);
  flights.set(withFlight(flights.get(), { ...extended(known, news), heardAt: before(momentNow(), news.age_s) }));
}

function applyPhase(campaignId: number, trialId: number, phase: string): void {
  const known = flights.get().get(trialId) ?? begun(campaignId, trialId);
  flights.set(withFlight(flights.get(), { ...known, phase, heardAt: momentNow() }));
}

function applyStatus(status: VehicleStatus): void {
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

const GATHER_MS = 40;
const AGAIN_MS = 1000;
const HIDDEN_MS = 20_000;
/** The server sends an event at least every three seconds; a stream without events for longer is dead. */
const SILENT_S = 8;
const WATCH_MS = 1000;
const MAX_SINCE_S = 60;
const MARGIN_S = 3;

/** Seconds since the page began to load, plus a margin: the first responses may be older than the stream, so the stream
 * begins with the changes since then. */
function sinceLoaded(): number {
  return Math.ceil(performance.now() / 1000) + MARGIN_S;
}

/**
 * Follow the stream until the returned function is called. The browser reconnects with `Last-Event-ID`; a stream that
 * had to be reopened has missed changes, so everything is refetched. A hidden tab closes its stream after a while,
 * unless a vehicle flies. A stream without events, after a sleep or a Wi-Fi loss, is closed and reopened.
 */
export function followEvents(queries: QueryClient, somethingFlies: () => boolean): () => void {
  const invalidator = createInvalidator(queries);
  let source: EventSource | null = null;
  let again: ReturnType<typeof setTimeout> | undefined;
  let hiding: ReturnType<typeof setTimeout> | undefined;
  let gathering: ReturnType<typeof setTimeout> | undefined;
  let gathered: Change[] = [];
  let fresh = true;
  let heard = momentNow();
  let opened = heard;

  const heardAt = (): string => new Date(heard.wallMs).toISOString();

  function refetch(): void {
    const changes = gathered;
    gathered = [];
    gathering = undefined;
    for (const queryKey of staleQueries(changes)) invalidator.invalidate({ queryKey });
  }

  function take(change: Change | null): void {
    if (change === null) return;
    gathered.push(change);
    gathering ??= setTimeout(refetch, GATHER_MS);
  }

  function hello(data: string): void {
    const { worker } = JSON.parse(data) as { worker?: boolean };
    setConnection({ state: "live", worker: worker ?? true });
    if (!fresh) invalidator.invalidate();
    fresh = false;
  }

  function open(): void {
    if (source !== null) return;
    const since = sinceLoaded();
    fresh &&= since <= MAX_SINCE_S;
    const stream = new EventSource(fresh ? `/api/events?since_s=${since}` : "/api/events");
    source = stream;
    opened = momentNow();
    const on = (name: string, listener: (data: string) => void): void =>
      stream.addEventListener(name, (event: MessageEvent<string>) => {
        heard = momentNow();
        listener(event.data);
      });
    on("hello", hello);
    on("reset", () => invalidator.invalidate());
    on("change", (data) => take(changeFrom(data)));
    on("worker", (data) => setConnection({ worker: (JSON.parse(data) as { worker: boolean }).worker }));
    on("telemetry", (data) => {
      const news = telemetryFrom(data);
      if (news !== null) applyTelemetry(news);
    });
    on("vehicle", (data) => {
      const status = statusFrom(data);
      if (status !== null) applyStatus(status);
    });
    on("phase", (data) => {
      const { campaign_id, trial_id, phase } = JSON.parse(data) as {
        campaign_id: number;
        trial_id: number;
        phase: string;
      };
      applyPhase(campaign_id, trial_id, phase);
    });
    stream.onerror = () => {
      fresh = false;
      setNotLive("away", heardAt());
      if (stream.readyState !== EventSource.CLOSED) return;
      close();
      again = setTimeout(open, AGAIN_MS);
    };
  }

  function close(): void {
    clearTimeout(again);
    source?.close();
    source = null;
  }

  function letGo(): void {
    if (somethingFlies()) hiding = setTimeout(letGo, HIDDEN_MS);
    else {
      close();
      setNotLive("connecting", heardAt());
    }
  }

  /** Reopen a stream whose next event is overdue. */
  function watch(): void {
    const now = momentNow();
    if (source === null || secondsBetween(heard, now) < SILENT_S) return;
    setNotLive("away", heardAt());
    if (secondsBetween(opened, now) < SILENT_S) return;
    close();
    open();
  }

  function onVisibility(): void {
    clearTimeout(hiding);
    if (document.visibilityState === "hidden") hiding = setTimeout(letGo, HIDDEN_MS);
    else {
      watch();
      open();
    }
  }

  const watching = setInterval(watch, WATCH_MS);
  document.addEventListener("resume", watch);
  window.addEventListener("online", watch);
  document.addEventListener("visibilitychange", onVisibility);
  open();
  return () => {
    document.removeEventListener("visibilitychange", onVisibility);
    document.removeEventListener("resume", watch);
    window.removeEventListener("online", watch);
    clearInterval(watching);
    clearTimeout(hiding);
    clearTimeout(gathering);
    invalidator.stop();
    close();
  };
}
