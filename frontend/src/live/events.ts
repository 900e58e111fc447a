/** The event stream of the tab: changes invalidate queries, telemetry feeds the live curves. */

import type { QueryClient } from "@tanstack/react-query";
import { type Change, changeFrom, createInvalidator, staleQueries } from "./staleQueries";
import { applyPhase, applyStatus, applyTelemetry, momentNow, setConnection, setNotLive } from "./store";
import { telemetryFrom } from "./telemetry";
import { secondsBetween, statusFrom } from "./vehicleStatus";

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
