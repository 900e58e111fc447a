import type { Plotly } from "plotly.js-basic-dist-min";
import { useEffect, useRef, useState } from "react";
import type { TimeRange } from "../api/queries";
import { liveNow } from "../live/store";
import { afterPaint } from "../ui/throttle";
import classes from "./Chart.module.css";
import {
  type Build,
  CONFIG,
  type CurveOf,
  drawLive,
  followPointing,
  listen,
  loadPlotly,
  type PlotlyElement,
} from "./plotly";
import { narrowed, type PlotlyFigure, traceWithRole, withLive } from "./traces";

interface Props {
  figure: PlotlyFigure;
  /** What the chart shows, for those who cannot see it; the data table says the rest. */
  label: string;
  /** In pixels; null fills what holds it. */
  height: number | null;
  liveTrial?: number | null;
  onChoose?: ((trial: number) => void) | undefined;
  /** The seconds that a zoom leaves in sight, null for all. */
  onWindow?: ((window: TimeRange | null) => void) | undefined;
  curveOf?: CurveOf | undefined;
  /** Of the chart library; the same for as long as the chart is there. */
  build?: Build | undefined;
}

const NARROW_PX = 420;
const coarse = window.matchMedia("(pointer: coarse)");

/** Brushing zooms with a mouse; a finger has to be able to scroll the page. */
function layoutFor({ data, layout }: PlotlyFigure, width: number): Record<string, unknown> {
  const fitting = width < NARROW_PX ? narrowed(layout, data, width) : layout;
  // A copy: Plotly writes a zoom into the layout that it is given, and the figure has to stay what it was.
  return { ...structuredClone(fitting), autosize: true, ...(coarse.matches ? { dragmode: false } : {}) };
}

function wholeOf({ layout }: PlotlyFigure): TimeRange | null {
  const { xaxis } = layout as { xaxis?: { range?: TimeRange } };
  return xaxis?.range ?? null;
}

export function Chart({ figure, label, height, liveTrial = null, onChoose, onWindow, curveOf, build }: Props) {
  const element = useRef<HTMLDivElement & PlotlyElement>(null);
  const [plotly, setPlotly] = useState<Plotly | null>(null); // once it has drawn
  const [broken, setBroken] = useState<string | null>(null);
  const queue = useRef<Promise<unknown>>(Promise.resolve());

  useEffect(() => {
    const target = element.current;
    if (target === null) return;
    let wanted = true;
    queue.current = queue.current.then(async () => {
      try {
        const library = await loadPlotly(build);
        await afterPaint();
        if (!wanted) return;
        await library.react(
          target,
          withLive(figure.data, liveNow(liveTrial)),
          layoutFor(figure, target.clientWidth),
          CONFIG,
        );
        listen(target, figure.data, { whole: wholeOf(figure), onChoose, onWindow });
        setPlotly(library);
        setBroken(null);
      } catch (error) {
        setBroken(error instanceof Error ? error.message : String(error));
      }
    });
    return () => {
      wanted = false;
    };
  }, [figure, liveTrial, onChoose, onWindow, build]);

  useEffect(() => {
    const target = element.current;
    const trace = traceWithRole(figure.data, "live");
    if (target === null || plotly === null || liveTrial === null || trace < 0) return;
    return drawLive(plotly, target, trace, liveTrial);
  }, [plotly, liveTrial, figure]);

  useEffect(() => {
    const target = element.current;
    if (target === null || plotly === null) return;
    return followPointing(plotly, target, figure.data, curveOf);
  }, [plotly, figure, curveOf]);

  useEffect(() => {
    const target = element.current;
    if (target === null || plotly === null) return;
    // A page that was left resizes its charts to nothing, and by then there may be none to resize.
    const observer = new ResizeObserver(() => void (target.offsetParent !== null && plotly.Plots.resize(target)));
    observer.observe(target);
    return () => {
      observer.disconnect();
      plotly.purge(target);
    };
  }, [plotly]);

  return (
    // biome-ignore lint/a11y/useSemanticElements: a fieldset is for forms; this groups a drawing's parts under one name
    <div
      role="group"
      aria-label={label}
      className={classes["frame"]}
      style={{ height: height === null ? "100%" : `min(${height}px, var(--tallest, 96vw))` }}
    >
      {broken !== null && (
        <p className={classes["broken"]}>The chart could not be drawn ({broken}). Its data table still works.</p>
      )}
      {plotly === null && broken === null && <div className={classes["waiting"]} aria-hidden />}
      <div ref={element} className={classes["plot"]} data-drawn={plotly !== null || undefined} />
    </div>
  );
}
