/** Changes to the server's figures: the live curve, and the highlight of the selected flight. */

import type { TimeRange } from "../api/queries";
import type { LiveFlight } from "../live/telemetry";

interface TraceMeta {
  role?: string;
  trial?: number;
  standing?: string;
  edge?: "lower" | "upper";
  gain?: string;
  /** Number of the next flight, whose values are the last ones. */
  next?: number;
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

interface LiveCurve {
  x: number[];
  y: number[];
  showlegend: boolean;
}

/** What has been measured, by the place of the trace that shows it: the output, and its deviation from its target. */
export function liveCurves(traces: readonly Trace[], { timeS, measured }: LiveFlight): Map<number, LiveCurve> {
  const curves = new Map<number, LiveCurve>();
  if (timeS.length === 0) return curves;
  const live = traceWithRole(traces, "live");
  const deviation = traceWithRole(traces, "live deviation");
  const target = traces[traceWithRole(traces, "target")];
  if (live >= 0) curves.set(live, { ...brokenAtGaps(timeS, measured), showlegend: true });
  if (deviation >= 0 && target !== undefined) {
    const { x, y } = deviationFrom(target, timeS, measured);
    curves.set(deviation, { ...brokenAtGaps(x, y), showlegend: false });
  }
  return curves;
}

const GAP_S = 1;

/** The curve with a missing value in each interval without samples: nothing is known there. */
function brokenAtGaps(x: number[], y: number[]): { x: number[]; y: number[] } {
  const starts = x.flatMap((time, place) => (time - (x[place - 1] ?? time) > GAP_S ? [place] : []));
  if (starts.length === 0) return { x, y };
  const within = (all: number[], value: (place: number) => number): number[] =>
    all.flatMap((each, place) => (starts.includes(place) ? [value(place), each] : [each]));
  return { x: within(x, (place) => x[place - 1] as number), y: within(y, () => Number.NaN) };
}

/** Output − target, from the command on. */
function deviationFrom(
  target: Trace,
  timeS: readonly number[],
  output: readonly number[],
): { x: number[]; y: number[] } {
  const first = timeS.findIndex((time) => time >= 0);
  const x = first < 0 ? [] : timeS.slice(first);
  const wanted = interpolated(x, target.x as number[], target.y as number[]);
  const y = wanted.map((value, place) => (output[first + place] ?? Number.NaN) - value);
  return { x, y };
}

/** Values of a polyline at ascending places; constant beyond its ends. */
function interpolated(at: readonly number[], xs: readonly number[], ys: readonly number[]): number[] {
  let next = 0;
  return at.map((x) => {
    while (next < xs.length && (xs[next] as number) <= x) next += 1;
    const [left, right] = [Math.max(next - 1, 0), Math.min(next, xs.length - 1)];
    const [x0, x1, y0, y1] = [xs[left], xs[right], ys[left], ys[right]] as [number, number, number, number];
    return x1 > x0 ? y0 + ((y1 - y0) * (x - x0)) / (x1 - x0) : y0;
  });
}

/** The traces with what has been measured; unchanged without a flight. */
export function withLive(traces: readonly Trace[], flight: LiveFlight | null): Trace[] {
  if (flight === null) return [...traces];
  const curves = liveCurves(traces, flight);
  return traces.map((trace, place) => ({ ...trace, ...curves.get(place) }));
}

type Points = { time_s: number[]; values: number[] } | null;

export interface DrawnPrediction {
  curve: Points;
  lower: Points;
  upper: Points;
}

const PREDICTED = new Set(["prediction", "band", "predicted deviation"]);

/**
 * The predicted curve, the edges of its band and its deviation from its target, by the place of the trace that shows
 * each; the figure's for null.
 */
export function predictedCurves(
  traces: readonly Trace[],
  prediction: DrawnPrediction | null,
): Map<number, { x: unknown[]; y: unknown[] }> {
  const curves = new Map<number, { x: unknown[]; y: unknown[] }>();
  const target = traces[traceWithRole(traces, "target")];
  traces.forEach(({ meta, x = [], y = [] }, place) => {
    if (!PREDICTED.has(meta?.role ?? "")) return;
    if (prediction === null) {
      curves.set(place, { x, y });
      return;
    }
    const { time_s = [], values = [] } = prediction[meta?.edge ?? "curve"] ?? {};
    const isDeviation = meta?.role === "predicted deviation" && target !== undefined;
    curves.set(place, isDeviation ? deviationFrom(target, time_s, values) : { x: time_s, y: values });
  });
  return curves;
}

/** The traces with another predicted curve, with its band and deviation; with the figure's own for null. */
export function withPrediction(traces: readonly Trace[], prediction: DrawnPrediction | null): Trace[] {
  const curves = predictedCurves(traces, prediction);
  return traces.map((trace, place) => ({ ...trace, ...curves.get(place) }));
}

const FADED = 0.22;
/** Roles of a flight's own curves. */
const CURVES = new Set(["flight", "deviation"]);

/**
 * Highlight the selected flight and fade the others; a legend entry that only it has gives way to its own. Set point,
 * prediction and live curve are unchanged.
 */
export function withChosen(traces: readonly Trace[], trial: number | null): Trace[] {
  if (trial === null || !traces.some((trace) => trace.meta?.role === "flight" && trace.meta.trial === trial)) {
    return [...traces];
  }
  const flights = traces.filter(({ meta }) => meta?.role === "flight");
  const standing = flights.find(({ meta }) => meta?.trial === trial)?.meta?.standing;
  const isAlone = flights.filter(({ meta }) => meta?.standing === standing).length === 1;
  return traces.map((trace) => {
    const { role, standing: own } = trace.meta ?? {};
    if (isAlone && role === "legend" && own === standing) return { ...trace, visible: false };
    if (!CURVES.has(trace.meta?.role ?? "")) return trace;
    return trace.meta?.trial === trial
      ? {
          ...trace,
          line: { ...trace.line, width: 3.5 },
          // Entries of one group stand below each other, and leave a hole beside them.
          legendgroup: "chosen",
          ...(trace.meta?.role === "flight" && { showlegend: true }),
        }
      : { ...trace, opacity: FADED };
  });
}

/** Roles of markers whose x value is the flight number. */
const FLOWN = new Set(["measured", "not counted", "not yet reviewed", "flown"]);
const NUMBERED = new Set([...FLOWN, "off scale", "off scale deviation", "best", "predicted"]);

/** The flight of a chart point, from Plotly's event; null for others. */
export function flightAt(traces: readonly Trace[], curveNumber: number, x: unknown): number | null {
  const meta = traces[curveNumber]?.meta;
  if (CURVES.has(meta?.role ?? "") || meta?.role === "glitch") return meta?.trial ?? null;
  if (meta?.role === undefined || !NUMBERED.has(meta.role)) return null;
  return meta.trial ?? (typeof x === "number" ? x : null);
}

/** The points of a flight: one for each trace of markers that has it. */
export function marksOver(traces: readonly Trace[], flight: number): { curveNumber: number; pointNumber: number }[] {
  return traces.flatMap((trace, curveNumber) => {
    if (!FLOWN.has(trace.meta?.role ?? "")) return [];
    const pointNumber = trace.x?.indexOf(flight) ?? -1;
    return pointNumber < 0 ? [] : [{ curveNumber, pointNumber }];
  });
}

/** The visible time range, from Plotly's event: null for all of it, undefined if unchanged. */
export function windowFrom(event: Record<string, unknown>, whole: TimeRange): TimeRange | null | undefined {
  if (event["xaxis.autorange"] === true) return null;
  const range = event["xaxis.range"];
  const [from, to] = Array.isArray(range) ? range : [event["xaxis.range[0]"], event["xaxis.range[1]"]];
  if (typeof from !== "number" || typeof to !== "number") return undefined;
  return from <= whole[0] && to >= whole[1] ? null : [from, to];
}

const LETTER_PX = 5.8;
/** Width of the legend symbol and its margins. */
const SYMBOL_PX = 45;
const WHOLE_PX = 220;

/** Legend entry width: two per row if at most a letter or two is cut off, otherwise one. */
function entryWidth(letters: number, half: number): number {
  const wanted = LETTER_PX * letters;
  return Math.min(wanted, wanted < 1.2 * half ? half : WHOLE_PX);
}

/** The layout for a narrow screen: a smaller legend, with columns as wide as its longest name. */
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

/** The axis range, extended if the curve's peak is above it. */
export function roomFor(range: readonly [number, number], values: readonly number[]): [number, number] {
  const peak = values.reduce((highest, value) => Math.max(highest, value), Number.NEGATIVE_INFINITY);
  const [low, high] = range;
  return peak <= high ? [low, high] : [low, low + 1.1 * (peak - low)];
}

const LIMIT_SHARE = 0.94;

/** The figure with the altitude limit, which it hides otherwise, and room for it; unchanged without a limit. */
export function withLimit(figure: PlotlyFigure, groundM: number): PlotlyFigure {
  const limit = figure.data[traceWithRole(figure.data, "limit")];
  const aboveGround = limit?.y?.[0];
  if (limit?.y === undefined || typeof aboveGround !== "number") return figure;
  const highest = aboveGround + groundM;
  const y = limit.y.map(() => highest);
  const { yaxis } = figure.layout as { yaxis?: { range?: [number, number] } };
  const [low, high] = yaxis?.range ?? [0, highest];
  return {
    data: figure.data.map((trace) => (trace === limit ? { ...trace, y, visible: true } : trace)),
    layout: { ...figure.layout, yaxis: { ...yaxis, range: [low, Math.max(high, highest / LIMIT_SHARE)] } },
  };
}

/** The time range of the whole flight, which the axis may not show at first. */
export function wholeFlight({ layout }: PlotlyFigure): TimeRange | null {
  const { meta } = layout as { meta?: { whole_s?: TimeRange } };
  return meta?.whole_s ?? null;
}

/** Title of the time range that the axis shows at first. */
export function openingTitle({ layout }: PlotlyFigure): string | undefined {
  return (layout as { meta?: { opening?: string } }).meta?.opening;
}

/** The layout with its first x axis limited to `range`; unchanged for null. */
export function withTimeRange(layout: Record<string, unknown>, range: readonly [number, number] | null) {
  if (range === null) return layout;
  const axis = typeof layout["xaxis"] === "object" && layout["xaxis"] !== null ? layout["xaxis"] : {};
  return { ...layout, xaxis: { ...axis, range: [...range] }, uirevision: range.join() };
}
