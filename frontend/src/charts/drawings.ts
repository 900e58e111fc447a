/** The drawings of one chart. */

import type { Plotly } from "plotly.js-basic-dist-min";
import { LONGEST_PAINT_MS } from "../ui/throttle";

export type Enqueue = (draw: () => Promise<void>) => Promise<void>;

/**
 * Draw one after the other: of two animations that overlap, Plotly never settles the promise of the first. A drawing that
 * fails is told, and does not stop those after it.
 */
export function createDrawings(onError: (error: unknown) => void): Enqueue {
  let last = Promise.resolve();
  return (draw) => {
    last = last.then(draw).catch(onError);
    return last;
  };
}

interface Curve {
  x: unknown[];
  y: unknown[];
}

/** Of curves one after the other, what Plotly wants: all of one kind. */
export function columnsOf(curves: readonly Curve[]) {
  return { x: curves.map(({ x }) => x), y: curves.map(({ y }) => y) };
}

const AT_ONCE = { mode: "immediate", frame: { duration: 0, redraw: false }, transition: { duration: 0 } } as const;

/**
 * Move curves without drawing any other again. An animation ends with a paint: where the browser paints nothing for half
 * a second, all curves are drawn instead.
 */
export async function moveCurves(
  plotly: Pick<Plotly, "animate" | "update">,
  chart: HTMLElement,
  curves: readonly Curve[],
  places: number[],
): Promise<void> {
  const data = curves.map(({ x, y }) => ({ x, y }));
  const moving = plotly.animate(chart, { data, traces: places }, AT_ONCE).then(
    () => true,
    () => false,
  );
  const paint = new Promise<boolean>((done) => setTimeout(() => done(false), LONGEST_PAINT_MS));
  if (await Promise.race([moving, paint])) return;
  await plotly.animate(chart, [], AT_ONCE); // drops what still waits for a paint
  await plotly.update(chart, columnsOf(curves), {}, places);
}
