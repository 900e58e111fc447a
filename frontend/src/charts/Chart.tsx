import { Box, Text } from "@mantine/core";
import type { Plotly } from "plotly.js-basic-dist-min";
import { useEffect, useLayoutEffect, useRef, useState } from "react";
import type { TimeRange } from "../api/queries";
import { liveNow } from "../live/store";
import { afterPaint } from "../ui/throttle";
import classes from "./Chart.module.css";
import { createDrawings } from "./drawings";
import {
  type Build,
  CONFIG,
  type CurveOf,
  drawLive,
  drawPrediction,
  followPointing,
  listen,
  loadPlotly,
  type PlotlyElement,
} from "./plotly";
import { type DrawnPrediction, narrowed, type PlotlyFigure, traceWithRole, withLive, withPrediction } from "./traces";

export interface ChartProps {
  figure: PlotlyFigure;
  /** Text alternative for screen readers; the data table has the details. */
  label: string;
  /** In pixels; null fills the container. */
  height: number | null;
  /** Where the screen is too narrow for that height. */
  tallest?: string;
  liveTrial?: number | null | undefined;
  onChoose?: ((trial: number) => void) | undefined;
  /** Called with the x value that is clicked. */
  onPlace?: ((x: number) => void) | undefined;
  /** Called with the zoomed time range; null for the whole range. */
  onWindow?: ((window: TimeRange | null) => void) | undefined;
  /** Called on a double click, which also undoes the zoom. */
  onReset?: (() => void) | undefined;
  curveOf?: CurveOf | undefined;
  /** Drawn in place of the figure's own prediction; null for that. A change of it alone redraws no other curve. */
  prediction?: DrawnPrediction | null | undefined;
  /** Build of the chart library; constant for the lifetime of the chart. */
  build?: Build | undefined;
}

const NARROW_PX = 420;
const coarse = window.matchMedia("(pointer: coarse)");

/** Dragging zooms with a mouse; with a finger it scrolls the page. */
function layoutFor({ data, layout }: PlotlyFigure, width: number): Record<string, unknown> {
  const fitting = width < NARROW_PX ? narrowed(layout, data, width) : layout;
  // A copy, because Plotly writes the zoom into the layout.
  return { ...structuredClone(fitting), autosize: true, ...(coarse.matches ? { dragmode: false } : {}) };
}

function legendFor(figure: PlotlyFigure, width: number): Record<string, unknown> {
  const { legend } = layoutFor(figure, width);
  return legend === undefined ? {} : { legend };
}

function wholeOf({ layout }: PlotlyFigure): TimeRange | null {
  const { xaxis } = layout as { xaxis?: { range?: TimeRange } };
  return xaxis?.range ?? null;
}

export function Chart({
  figure,
  label,
  height,
  tallest = "96vw",
  liveTrial = null,
  onChoose,
  onPlace,
  onWindow,
  onReset,
  curveOf,
  prediction,
  build,
}: ChartProps) {
  const element = useRef<HTMLDivElement & PlotlyElement>(null);
  const [plotly, setPlotly] = useState<Plotly | null>(null); // once it has drawn
  const [broken, setBroken] = useState<string | null>(null);
  const [enqueue] = useState(() =>
    createDrawings((error) => setBroken(error instanceof Error ? error.message : String(error))),
  );
  const drawn = useRef<{ figure: PlotlyFigure; prediction: ChartProps["prediction"] } | null>(null);
  const latestPrediction = useRef(prediction);
  latestPrediction.current = prediction;

  useEffect(() => {
    const target = element.current;
    if (target === null) return;
    let wanted = true;
    void enqueue(async () => {
      const library = await loadPlotly(build);
      if (drawn.current?.figure !== figure) await afterPaint();
      if (!wanted) return;
      const predicted = latestPrediction.current;
      drawn.current = { figure, prediction: predicted };
      await library.react(
        target,
        withLive(predicted === undefined ? figure.data : withPrediction(figure.data, predicted), liveNow(liveTrial)),
        layoutFor(figure, target.clientWidth),
        CONFIG,
      );
      listen(target, figure.data, { whole: wholeOf(figure), onChoose, onPlace, onWindow, onReset });
      setPlotly(library);
      setBroken(null);
    });
    return () => {
      wanted = false;
    };
  }, [figure, liveTrial, onChoose, onPlace, onWindow, onReset, build, enqueue]);

  useLayoutEffect(() => {
    const target = element.current;
    if (target === null || plotly === null || prediction === undefined) return;
    let wanted = true;
    void enqueue(async () => {
      const last = drawn.current;
      if (!wanted || last?.figure !== figure || last.prediction === prediction) return;
      drawn.current = { figure, prediction };
      await drawPrediction(plotly, target, figure.data, prediction);
    });
    return () => {
      wanted = false;
    };
  }, [plotly, figure, prediction, enqueue]);

  useEffect(() => {
    const target = element.current;
    if (target === null || plotly === null || liveTrial === null) return;
    if (traceWithRole(figure.data, "live") < 0) return;
    let wanted = true;
    const stop = drawLive(plotly, target, figure.data, liveTrial, (draw) =>
      enqueue(async () => {
        if (wanted) await draw();
      }),
    );
    return () => {
      wanted = false;
      stop();
    };
  }, [plotly, liveTrial, figure, enqueue]);

  useEffect(() => {
    const target = element.current;
    if (target === null || plotly === null) return;
    return followPointing(plotly, target, figure.data, curveOf);
  }, [plotly, figure, curveOf]);

  useEffect(() => {
    const target = element.current;
    if (target === null || plotly === null) return;
    // A page that was left resizes its charts to zero, when they may already be removed.
    let latest = 0;
    const refit = async () => {
      latest += 1;
      const own = latest;
      await plotly.Plots.resize(target); // of several in a row Plotly does the last
      await enqueue(async () => {
        // Plotly leaves the legend where it stood beside the former margins.
        if (own === latest && drawn.current)
          await plotly.update(target, {}, legendFor(drawn.current.figure, target.clientWidth), []);
      });
    };
    const observer = new ResizeObserver(() => void (target.offsetParent !== null && refit()));
    observer.observe(target);
    return () => {
      latest = 0;
      observer.disconnect();
      plotly.purge(target);
    };
  }, [plotly, enqueue]);

  return (
    <Box
      role="group"
      aria-label={label}
      pos="relative"
      style={{ height: height === null ? "100%" : `min(${height}px, ${tallest})` }}
    >
      {broken !== null && (
        <Text p={24} c="var(--bad)">
          The chart could not be drawn ({broken}). Its data table is still available.
        </Text>
      )}
      {plotly === null && broken === null && <div className={classes["waiting"]} aria-hidden />}
      <div ref={element} className={classes["plot"]} data-drawn={plotly !== null || undefined} />
    </Box>
  );
}
