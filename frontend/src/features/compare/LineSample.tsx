import type { FigureCard } from "../../api/types";
import type { PlotlyFigure } from "../../charts/traces";
import classes from "./Compare.module.css";

export interface LineStyle {
  colour: string;
  dash: string;
}

/** Plotly's dash patterns for the sample line. */
const DASHES: Readonly<Record<string, string>> = {
  dash: "7 4",
  dot: "2 3",
  dashdot: "7 3 2 3",
  longdash: "12 4",
  longdashdot: "12 3 2 3",
};

/** Line style of each flight in the figure. */
export function lineStylesOf(card: FigureCard | undefined): Map<number, LineStyle> {
  const traces = (card?.figure as unknown as PlotlyFigure | null | undefined)?.data ?? [];
  return new Map(
    traces.flatMap(({ meta, line }) =>
      meta?.role === "flight" && meta.trial !== undefined
        ? [[meta.trial, { colour: String(line?.["color"]), dash: String(line?.["dash"]) }] as const]
        : [],
    ),
  );
}

/** Sample of a flight's line in the figure. */
export function LineSample({ pen }: { pen: LineStyle }) {
  return (
    <svg width="44" height="12" aria-hidden className={classes["stroke"]}>
      <line x1="1" y1="6" x2="43" y2="6" stroke={pen.colour} strokeWidth="3" strokeDasharray={DASHES[pen.dash]} />
    </svg>
  );
}
