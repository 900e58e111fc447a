/** Small multiples: curves as SVG paths in a box, all on one scale. */

export type Point = readonly [number, number];

export interface Box {
  width: number;
  height: number;
}

export interface Scale {
  x: readonly [number, number];
  y: readonly [number, number];
}

/** One scale for all curves; a curve that leaves it is cut at the edge. */
export function scaleFor(curves: readonly (readonly Point[])[], setPoint: number): Scale {
  const times = curves.flatMap((curve) => curve.map((point) => point[0]));
  return { x: [Math.min(0, ...times), Math.max(1, ...times)], y: [0, 1.35 * setPoint] };
}

export function path(curve: readonly Point[], scale: Scale, box: Box): string {
  const place = (value: number, [low, high]: readonly [number, number], length: number): number =>
    (Math.min(Math.max(value, low), high) - low) * (length / (high - low));
  return curve
    .map(([time, value], index) => {
      const x = place(time, scale.x, box.width).toFixed(1);
      const y = (box.height - place(value, scale.y, box.height)).toFixed(1);
      return `${index === 0 ? "M" : "L"}${x} ${y}`;
    })
    .join("");
}
