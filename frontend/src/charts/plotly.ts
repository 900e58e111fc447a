/** The chart library, loaded when the first chart is drawn. */

import type { Plotly } from "plotly.js-basic-dist-min";
import type { TimeRange } from "../api/queries";
import { onLive } from "../live/store";
import type { LiveFlight } from "../live/telemetry";
import { throttled } from "../ui/throttle";
import { columnsOf, type Enqueue, moveCurves } from "./drawings";
import { onPointed, pointAt } from "./pointing";
import {
  type DrawnPrediction,
  flightAt,
  liveCurves,
  marksOver,
  predictedCurves,
  roomFor,
  type Trace,
  traceWithRole,
  windowFrom,
} from "./traces";

const BUILDS = {
  /** Lines and markers, enough for nearly every chart, and a fifth smaller than the full build. */
  lines: () => import("plotly.js-basic-dist-min"),
  contours: () => import("plotly.js-cartesian-dist-min"),
} as const;

export type Build = keyof typeof BUILDS;

const loading = new Map<Build, Promise<Plotly>>();

export function loadPlotly(build: Build = "lines"): Promise<Plotly> {
  const known = loading.get(build);
  if (known !== undefined) return known;
  const asked = BUILDS[build]().then(
    (module) => module.default,
    (error: unknown) => {
      loading.delete(build);
      throw error;
    },
  );
  loading.set(build, asked);
  return asked;
}

/** No data leaves this machine: without Plotly's upload and edit buttons. */
export const CONFIG = {
  displayModeBar: window.matchMedia("(pointer: coarse)").matches ? false : "hover",
  displaylogo: false,
  showSendToCloud: false,
  plotlyServerURL: "",
  doubleClick: "reset",
  showTips: false,
  modeBarButtons: [["toImage", "resetScale2d"]],
} as const;

const SHORTEST_REDRAW_MS = 90;

interface Point {
  curveNumber: number;
  x: unknown;
}

export interface PlotlyElement extends HTMLElement {
  data?: Trace[];
  layout?: { yaxis?: { range?: [number, number] } };
  on?(event: "plotly_click" | "plotly_hover", listener: (event: { points: Point[] }) => void): void;
  on?(event: "plotly_unhover" | "plotly_doubleclick", listener: () => void): void;
  on?(event: "plotly_relayout", listener: (event: Record<string, unknown>) => void): void;
  removeAllListeners?(event: string): void;
}

/** Loads the curve of a flight that is not drawn individually. */
export type CurveOf = (flight: number) => Promise<{ x: number[]; y: number[] } | null>;

export interface Listeners {
  /** The time range of the figure without a zoom. */
  whole: TimeRange | null;
  onChoose?: ((flight: number) => void) | undefined;
  /** Called with the x value that is clicked. */
  onPlace?: ((x: number) => void) | undefined;
  onWindow?: ((window: TimeRange | null) => void) | undefined;
  /** Called on a double click, which also undoes the zoom. */
  onReset?: (() => void) | undefined;
}

const SETTLED_MS = 250;

/** Report hovered and clicked flights, and the time range after a zoom has settled. */
export function listen(
  chart: PlotlyElement,
  traces: readonly Trace[],
  { whole, onChoose, onPlace, onWindow, onReset }: Listeners,
): void {
  for (const event of ["click", "hover", "unhover", "doubleclick", "relayout"])
    chart.removeAllListeners?.(`plotly_${event}`);
  const flightOf = ([point]: Point[]) => (point ? flightAt(traces, point.curveNumber, point.x) : null);
  chart.on?.("plotly_click", ({ points }) => {
    const flight = flightOf(points);
    if (flight !== null) onChoose?.(flight);
    const x = points[0]?.x;
    if (typeof x === "number") onPlace?.(x);
  });
  chart.on?.("plotly_hover", ({ points }) => chart.matches(":hover") && pointAt(flightOf(points)));
  chart.on?.("plotly_unhover", () => chart.matches(":hover") && pointAt(null));
  chart.on?.("plotly_doubleclick", () => onReset?.());
  chart.onmouseleave = () => pointAt(null);
  let settling: ReturnType<typeof setTimeout> | undefined;
  chart.on?.("plotly_relayout", (event) => {
    const seconds = whole && onWindow ? windowFrom(event, whole) : undefined;
    if (seconds === undefined) return;
    clearTimeout(settling);
    settling = setTimeout(() => onWindow?.(seconds), SETTLED_MS);
  });
}

const DWELL_MS = 150;

/** Highlight the flight that is hovered elsewhere: its curve by style, its markers by their labels. */
export function followPointing(
  plotly: Plotly,
  chart: PlotlyElement,
  traces: readonly Trace[],
  curveOf?: CurveOf,
): () => void {
  const spare = traceWithRole(traces, "pointed");
  let dwelling: ReturnType<typeof setTimeout> | undefined;
  let wanted: number | null = null;
  let lent = false;

  async function lend(flight: number | null): Promise<void> {
    const curve = flight === null ? null : await curveOf?.(flight);
    if (wanted !== flight || (!curve && !lent)) return;
    lent = Boolean(curve);
    chart.toggleAttribute("data-pointing", lent);
    const change = { x: [curve?.x ?? []], y: [curve?.y ?? []], name: `Flight ${flight}` };
    await plotly.update(chart, change, {}, [spare]);
  }

  const unfollow = onPointed((flight) => {
    wanted = flight;
    clearTimeout(dwelling);
    for (const group of chart.querySelectorAll("[data-pointed]")) group.removeAttribute("data-pointed");
    const curves = chart.querySelectorAll(`:is(.traceflight-${flight}, .tracedeviation-${flight})`);
    for (const one of curves) one.setAttribute("data-pointed", "");
    const drawn = curves.length > 0;
    chart.toggleAttribute("data-pointing", drawn);
    if (spare >= 0 && (lent || (flight !== null && !drawn))) {
      dwelling = setTimeout(() => void lend(drawn ? null : flight), DWELL_MS);
    }
    if (!chart.matches(":hover")) label(flight === null ? [] : marksOver(traces, flight));
  });

  function label(marks: { curveNumber: number; pointNumber: number }[]): void {
    if (spare >= 0) return;
    if (marks.length === 0) {
      plotly.Fx.unhover(chart);
      return;
    }
    const subplots = marks.map(({ curveNumber }) => {
      const { xaxis, yaxis } = traces[curveNumber] ?? {};
      return `${xaxis ?? "x"}${yaxis ?? "y"}`;
    });
    plotly.Fx.hover(chart, marks, subplots);
  }

  return () => {
    unfollow();
    clearTimeout(dwelling);
  };
}

/** Draw another prediction with its band. While it only moves, no other curve is drawn again. */
export async function drawPrediction(
  plotly: Plotly,
  chart: PlotlyElement,
  traces: readonly Trace[],
  prediction: DrawnPrediction | null,
): Promise<void> {
  const drawn = predictedCurves(traces, prediction);
  const [places, curves] = [[...drawn.keys()], [...drawn.values()]];
  const onlyMoves = curves.every(({ x }, index) => x.length > 0 && chart.data?.[places[index] as number]?.x?.length);
  if (onlyMoves) await moveCurves(plotly, chart, curves, places);
  else await plotly.update(chart, columnsOf(curves), {}, places);
}

/**
 * Extend the live traces with the telemetry of a trial, among the chart's other drawings; returns the unsubscribe
 * function. While they only grow, nothing else is drawn again.
 */
export function drawLive(
  plotly: Plotly,
  chart: HTMLElement,
  traces: readonly Trace[],
  trialId: number,
  enqueue: Enqueue,
): () => void {
  let latest: LiveFlight | null = null;
  let isBegun = false;
  const draw = async (): Promise<void> => {
    if (latest === null || latest.timeS.length === 0) return;
    const drawn = liveCurves(traces, latest);
    const [places, curves] = [[...drawn.keys()], [...drawn.values()]];
    const range = (chart as PlotlyElement).layout?.yaxis?.range ?? [0, Infinity];
    const room = roomFor(range, latest.measured);
    if (isBegun && room[0] === range[0] && room[1] === range[1]) {
      await moveCurves(plotly, chart, curves, places);
      return;
    }
    const change = { ...columnsOf(curves), showlegend: curves.map(({ showlegend }) => showlegend) };
    await plotly.update(chart, change, Number.isFinite(room[1]) ? { "yaxis.range": room } : {}, places);
    isBegun = curves.every((curve) => curve.x.length > 0);
  };
  const drawing = throttled(() => enqueue(draw), SHORTEST_REDRAW_MS);
  const unfollow = onLive(trialId, (flight) => {
    latest = flight;
    drawing.ask();
  });
  return () => {
    unfollow();
    drawing.stop();
  };
}
