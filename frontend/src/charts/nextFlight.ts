/** The next flight in the figures of errors and gains, with other gains than the proposed ones. */

import type { PlotlyFigure, Trace } from "./traces";

export interface NextFlight {
  /** Null while they are not known or cannot fly. */
  gains: Readonly<Record<string, number>> | null;
  predictedError: number | null;
  interval: { lower: number; upper: number } | null;
}

interface Points {
  y: (number | null)[];
  text: string[];
  /** Markers, where each point has its own. */
  symbols?: string[];
}

/** A bar, which ends with a gap, cut at the top of the axis. */
function bar(interval: NextFlight["interval"], top: number): Points {
  if (interval === null) return { y: [], text: [] };
  const { lower, upper } = interval;
  const text = `${lower.toFixed(4)} … ${upper.toFixed(4)}`;
  return { y: [Math.max(0, lower), Math.min(top, upper), null], text: [text, text, text] };
}

/** A diamond, or a triangle at the edge where the error is off the scale. */
function diamond(error: number | null, top: number): Points {
  if (error === null) return { y: [], text: [], symbols: [] };
  return {
    y: [Math.min(top, error)],
    text: [error.toFixed(4)],
    symbols: [error > top ? "triangle-up-open" : "diamond-open"],
  };
}

function withLast(trace: Trace, number: number, { y, text, symbols }: Points): Trace {
  const {
    x = [],
    y: values = [],
    text: texts = [],
    marker = {},
  } = trace as Trace & { text?: unknown[]; marker?: { symbol?: string[] } };
  const place = x.indexOf(number);
  const kept = place < 0 ? x.length : place;
  const numbers = [...x.slice(0, kept), ...y.map((value) => (value === null ? null : number))];
  return {
    ...trace,
    x: numbers,
    y: [...values.slice(0, kept), ...y],
    text: [...texts.slice(0, kept), ...text],
    ...(symbols && { marker: { ...marker, symbol: [...(marker.symbol ?? []).slice(0, kept), ...symbols] } }),
    visible: numbers.length > 0,
  };
}

/** The figure of the errors, with the prediction of these gains in place of the proposed ones. */
export function withNextError({ data, layout }: PlotlyFigure, next: NextFlight): PlotlyFigure {
  const { yaxis } = layout as { yaxis?: { range?: [number, number] } };
  const top = yaxis?.range?.[1] ?? Number.POSITIVE_INFINITY;
  const points: Record<string, Points> = {
    interval: bar(next.interval, top),
    predicted: diamond(next.predictedError, top),
  };
  return {
    layout,
    data: data.map((trace) => {
      const { role = "", next: number } = trace.meta ?? {};
      const own = points[role];
      return own === undefined || number === undefined ? trace : withLast(trace, number, own);
    }),
  };
}

const ROOM = 0.08;

/** The figure of the gains, with these in place of the proposed ones, and room for them. */
export function withNextGains({ data, layout }: PlotlyFigure, { gains }: NextFlight): PlotlyFigure {
  const axes: Record<string, unknown> = {};
  const moved = data.map((trace) => {
    const { role, gain = "" } = trace.meta ?? {};
    if (role !== "next") return trace;
    const value = gains?.[gain];
    if (value === undefined) return { ...trace, visible: false };
    const name = String(trace["yaxis"]).replace("y", "yaxis");
    const axis = layout[name] as { range: [number, number] };
    axes[name] = { ...axis, range: including(axis.range, value) };
    return { ...trace, y: [value] };
  });
  return { data: moved, layout: { ...layout, ...axes } };
}

function including([low, high]: readonly [number, number], value: number): [number, number] {
  const room = ROOM * (Math.max(high, value) - Math.min(low, value));
  return [value < low ? value - room : low, value > high ? value + room : high];
}
