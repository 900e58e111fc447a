/** The tab's one event stream: changes make cached answers doubtful, telemetry feeds the live curves. */

import type { QueryClient } from "@tanstack/react-query";
import { type Change, changeFrom, doubtfulOnce } from "../lib/events";
import { telemetryFrom } from "../lib/live";
import { statusFrom } from "../lib/vehicle";
import { setConnection, takePhase, takeStatus, takeTelemetry } from "../live/store";

const GATHER_MS = 40;
const AGAIN_MS = 1000;
const HIDDEN_MS = 20_000;

/**
 * Follow the stream until the returned function is called. The browser itself comes back with `Last-Event-ID`; a
 * stream that had to be opened anew has missed changes, so everything is then read again. A hidden tab lets go of its
 * stream after a while, unless something flies.
 */
export function followEvents(queries: QueryClient, somethingFlies: () => boolean): () => void {
  let source: EventSource | null = null;
  let again: ReturnType<typeof setTimeout> | undefined;
  let hiding: ReturnType<typeof setTimeout> | undefined;
  let gathering: ReturnType<typeof setTimeout> | undefined;
  let gathered: Change[] = [];
  let fresh = true;

  function refetch(): void {
    const changes = gathered;
    gathered = [];
    gathering = undefined;
    for (const queryKey of doubtfulOnce(changes)) void queries.invalidateQueries({ queryKey });
  }

  function take(change: Change | null): void {
    if (change === null) return;
    gathered.push(change);
    gathering ??= setTimeout(refetch, GATHER_MS);
  }

  function hello(data: string): void {
    const { worker } = JSON.parse(data) as { worker?: boolean };
    setConnection({ state: "live", worker: worker ?? true });
    if (!fresh) void queries.invalidateQueries();
    fresh = false;
  }

  function open(): void {
    if (source !== null) return;
    const stream = new EventSource("/api/events");
    source = stream;
    const on = (name: string, listener: (data: string) => void): void =>
      stream.addEventListener(name, (event: MessageEvent<string>) => listener(event.data));
    on("hello", hello);
    on("reset", () => void queries.invalidateQueries());
    on("change", (data) => take(changeFrom(data)));
    on("worker", (data) => setConnection({ worker: (JSON.parse(data) as { worker: boolean }).worker }));
    on("telemetry", (data) => {
      const news = telemetryFrom(data);
      if (news !== null) takeTelemetry(news);
    });
    on("vehicle", (data) => {
      const status = statusFrom(data);
      if (status !== null) takeStatus(status);
    });
    on("phase", (data) => {
      const { campaign_id, trial_id, phase } = JSON.parse(data) as {
        campaign_id: number;
        trial_id: number;
        phase: string;
      };
      takePhase(campaign_id, trial_id, phase);
    });
    stream.onerror = () => {
      setConnection({ state: "away" });
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
    else close();
  }

  function onVisibility(): void {
    clearTimeout(hiding);
    if (document.visibilityState === "hidden") hiding = setTimeout(letGo, HIDDEN_MS);
    else open();
  }

  document.addEventListener("visibilitychange", onVisibility);
  open();
  return () => {
    document.removeEventListener("visibilitychange", onVisibility);
    clearTimeout(hiding);
    clearTimeout(gathering);
    close();
  };
}
