/** The chart library as a chunk of its own, fetched when the first chart is drawn. */

import type Plotly from "plotly.js-cartesian-dist-min";
import type { LiveFlight } from "../lib/live";
import { paced } from "../lib/pace";
import { roomFor } from "../lib/traces";
import { onLive } from "../live/store";

let loading: Promise<typeof Plotly> | undefined;

export function loadPlotly(): Promise<typeof Plotly> {
  loading ??= import("plotly.js-cartesian-dist-min").then(
    (module) => module.default,
    (error: unknown) => {
      loading = undefined;
      throw error;
    },
  );
  return loading;
}

/** Nothing leaves this machine: Plotly's own upload and edit buttons stay out. */
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

interface PlotlyElement extends HTMLElement {
  layout?: { yaxis?: { range?: [number, number] } };
}

/** Grow the chart's live trace as telemetry of a trial comes; returns the function that ends it. */
export function drawLive(chart: HTMLElement, trace: number, trialId: number): () => void {
  let latest: LiveFlight | null = null;
  const drawing = paced(async () => {
    if (latest === null || latest.timeS.length === 0) return;
    const plotly = await loadPlotly();
    const change = { x: [latest.timeS], y: [latest.measured], showlegend: true };
    const room = roomFor((chart as PlotlyElement).layout?.yaxis?.range ?? [0, Infinity], latest.measured);
    await plotly.update(chart, change, Number.isFinite(room[1]) ? { "yaxis.range": room } : {}, [trace]);
  }, SHORTEST_REDRAW_MS);
  const unfollow = onLive(trialId, (flight) => {
    latest = flight;
    drawing.ask();
  });
  return () => {
    unfollow();
    drawing.stop();
  };
}
