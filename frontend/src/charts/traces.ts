/** What a page adds to a figure that the server drew: the live curve, and the emphasis on a chosen flight. */

import type { TimeRange } from "../api/queries";
import type { LiveFlight } from "../live/telemetry";

export interface TraceMeta {
  role?: string;
  trial?: number;
  standing?: string;
}

export interface Trace {
  meta?: TraceMeta;
  x?: unknown[];
  y?: unknown[];
  opacity?: number;
  showlegend?: boolean;
  line?: Record<string, unknown>;
  [property: string]: unknown;
}

export interface PlotlyFigure {
  data: Trace[];
  layout: Record<string, unknown>;
}

export function traceWithRole(traces: readonly Trace[], role: string): number {
  return traces.findIndex((trace) => trace.meta?.role === role);
}

/** The `live` trace filled with what has been measured so far; as it was when nothing flies. */
export function withLive(traces: readonly Trace[], flight: LiveFlight | null): Trace[] {
  if (flight === null || flight.timeS.length === 0) return [...traces];
  return traces.map((trace) =>
    trace.meta?.role === "live" ? { ...trace, x: flight.timeS, y: flight.measured, showlegend: true } : trace,
  );
}

const FADED = 0.22;

/** A chosen flight stands out and the other flights step back; goal, prediction and live curve stay. */
export function withChosen(traces: readonly Trace[], trial: number | null): Trace[] {
  if (trial === null || !traces.some((trace) => trace.meta?.role === "flight" && trace.meta.trial === trial)) {
    return [...traces];
  }
  return traces.map((trace) => {
    if (trace.meta?.role !== "flight") return trace;
    return trace.meta.trial === trial
      ? { ...trace, line: { ...trace.line, width: 3.5 }, showlegend: true }
      : { ...trace, opacity: FADED };
  });
}

/** Roles of marks that stand over the number of their flight. */
const FLOWN = new Set(["measured", "not counted", "not yet judged", "flown"]);
const NUMBERED = new Set([...FLOWN, "off scale", "best", "predicted"]);

/** The flight that a point of a chart belongs to, from Plotly's event; the prediction's flight is none yet. */
export function flightAt(traces: readonly Trace[], curveNumber: number, x: unknown): number | null {
  const meta = traces[curveNumber]?.meta;
  if (meta?.role === "flight" || meta?.role === "glitch") return meta.trial ?? null;
  if (meta?.role === undefined || !NUMBERED.has(meta.role)) return null;
  return meta.trial ?? (typeof x === "number" ? x : null);
}

/** The points that stand over a flight's number: one for each trace of marks that has it. */
export function marksOver(traces: readonly Trace[], flight: number): { curveNumber: number; pointNumber: number }[] {
  return traces.flatMap((trace, curveNumber) => {
    if (!FLOWN.has(trace.meta?.role ?? "")) return [];
    const pointNumber = trace.x?.indexOf(flight) ?? -1;
    return pointNumber < 0 ? [] : [{ curveNumber, pointNumber }];
  });
}

/** The part of the time axis that is looked at, from Plotly's event: null for all of it, undefined for no change. */
export function windowFrom(event: Record<string, unknown>, whole: TimeRange): TimeRange | null | undefined {
  if (event["xaxis.autorange"] === true) return null;
  const range = event["xaxis.range"];
  const [from, to] = Array.isArray(range) ? range : [event["xaxis.range[0]"], event["xaxis.range[1]"]];
  if (typeof from !== "number" || typeof to !== "number") return undefined;
  return from <= whole[0] && to >= whole[1] ? null : [from, to];
}

const LETTER_PX = 5.8;
/** What Plotly draws before a name, and leaves free after it. */
const SYMBOL_PX = 45;
const WHOLE_PX = 220;

/** The room for names of that length: two to a row, if at most a letter or two is lost, or one that is read whole. */
function entryWidth(letters: number, half: number): number {
  const wanted = LETTER_PX * letters;
  return Math.min(wanted, wanted < 1.2 * half ? half : WHOLE_PX);
}

/** The same layout for a narrow screen: a smaller legend in columns as wide as its longest name. */
export function narrowed(
  layout: Record<string, unknown>,
  traces: readonly Trace[],
  width: number,
): Record<string, unknown> {
  const named = traces.filter(({ showlegend }) => showlegend !== false);
  const longest = Math.max(0, ...named.map(({ name }) => (typeof name === "string" ? name.length : 0)));
  const { legend = {}, margin = {} } = layout as { legend?: { font?: object }; margin?: { l?: number; r?: number } };
  const half = (width - (margin.l ?? 0) - (margin.r ?? 0)) / 2 - SYMBOL_PX;
  return {
    ...layout,
    legend: {
      ...legend,
      font: { ...legend.font, size: 11 },
      entrywidth: entryWidth(longest, half),
      entrywidthmode: "pixels",
    },
  };
}

/** The top of an axis that a growing curve still fits under: `range` itself, or raised to the curve's peak. */
export function roomFor(range: readonly [number, number], values: readonly number[]): [number, number] {
  const peak = values.reduce((highest, value) => Math.max(highest, value), Number.NEGATIVE_INFINITY);
  const [low, high] = range;
  return peak <= high ? [low, high] : [low, low + 1.1 * (peak - low)];
}

/** The same layout with its first x axis cut to `range`, or as it was for null. */
export function withTimeRange(layout: Record<string, unknown>, range: readonly [number, number] | null) {
  if (range === null) return layout;
  const axis = typeof layout["xaxis"] === "object" && layout["xaxis"] !== null ? layout["xaxis"] : {};
  return { ...layout, xaxis: { ...axis, range: [...range] }, uirevision: range.join() };
}
