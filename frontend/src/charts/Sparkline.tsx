import type { SparkCurve } from "../api/types";
import { count } from "../ui/format";

const BOX = { width: 300, height: 84 };
const PEN = { vectorEffect: "non-scaling-stroke" };

function points(curve: SparkCurve): Point[] {
  return curve.time_s.map((time, index) => [time, curve.values[index] ?? 0]);
}

/** A campaign's curves in miniature: the first flight grey, the best in colour, the set point dotted. */
export function Sparkline({ curves, setPoint }: { curves: readonly SparkCurve[]; setPoint: number }) {
  const drawn = curves.map((curve) => ({ ...curve, points: points(curve) }));
  const scale = scaleFor(
    drawn.map((curve) => curve.points),
    setPoint,
  );
  const [low, high] = scale.y;
  const target = BOX.height * (1 - (setPoint - low) / (high - low));
  const ordered = [...drawn].sort((one, other) => Number(one.best) - Number(other.best));
  return (
    <svg
      viewBox={`0 0 ${BOX.width} ${BOX.height}`}
      width="100%"
      height={BOX.height}
      fill="none"
      preserveAspectRatio="none"
      role="img"
      aria-label={curves.length === 0 ? "No flights yet" : `Curves of ${count(curves.length, "flight")}`}
    >
      <line x2={BOX.width} y1={target} y2={target} {...PEN} stroke="var(--edge)" strokeDasharray="2 4" />
      {ordered.map((curve) => (
        <path
          key={curve.trial_number}
          d={path(curve.points, scale, BOX)}
          {...PEN}
          stroke={curve.best ? "var(--best)" : "var(--earlier)"}
          strokeWidth={curve.best ? 2.75 : 1.25}
        />
      ))}
    </svg>
  );
}

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

/** One scale for all curves, which are clipped to it: from the ground to above the set point; for a set point of zero,
 * symmetric, as far as the first flight deviates. */
export function scaleFor(curves: readonly (readonly Point[])[], setPoint: number): Scale {
  const times = curves.flatMap((curve) => curve.map((point) => point[0]));
  const x = [Math.min(0, ...times), Math.max(1, ...times)] as const;
  if (setPoint > 0) return { x, y: [0, 1.35 * setPoint] };
  const strays = Math.max(...(curves[0] ?? []).map((point) => Math.abs(point[1])), 0) || 1;
  return { x, y: [-1.1 * strays, 1.1 * strays] };
}

/** Slopes that keep a curve through `points` from overshooting them (Steffen, Astron. Astrophys. 239, 443, 1990). */
function slopes(points: readonly Point[]): number[] {
  const secants = points.slice(1).map(([x, y], index) => {
    const [before, value] = points[index] ?? [x, y];
    return { width: x - before, slope: x === before ? 0 : (y - value) / (x - before) };
  });
  return points.map((_, index) => {
    const [left, right] = [secants[index - 1], secants[index]];
    if (left === undefined || right === undefined) return (left ?? right)?.slope ?? 0;
    if (left.slope * right.slope <= 0) return 0;
    const mean = (left.slope * right.width + right.slope * left.width) / (left.width + right.width);
    return Math.sign(mean) * Math.min(2 * Math.abs(left.slope), 2 * Math.abs(right.slope), Math.abs(mean));
  });
}

/** A smooth curve through every point, as cubic Bézier pieces. */
export function path(curve: readonly Point[], scale: Scale, box: Box): string {
  const place = (value: number, [low, high]: readonly [number, number], length: number): number =>
    (Math.min(Math.max(value, low), high) - low) * (length / (high - low));
  const points = curve.map(
    ([time, value]): Point => [place(time, scale.x, box.width), box.height - place(value, scale.y, box.height)],
  );
  const slope = slopes(points);
  const at = (x: number, y: number): string => `${x.toFixed(1)} ${y.toFixed(1)}`;
  return points
    .map(([x, y], index) => {
      const before = points[index - 1];
      if (before === undefined) return `M${at(x, y)}`;
      const third = (x - before[0]) / 3;
      const [leaving, arriving] = [slope[index - 1] ?? 0, slope[index] ?? 0];
      return `C${at(before[0] + third, before[1] + leaving * third)} ${at(x - third, y - arriving * third)} ${at(x, y)}`;
    })
    .join("");
}
