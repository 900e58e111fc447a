import type { SparkCurve } from "../api/types";
import classes from "./Sparkline.module.css";
import { type Point, path, scaleFor } from "./sparkline";

const BOX = { width: 300, height: 84 };

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
      className={classes["spark"]}
      preserveAspectRatio="none"
      role="img"
      aria-label={curves.length === 0 ? "No flight yet" : `Curves of ${curves.length} flights`}
    >
      <line x1={0} x2={BOX.width} y1={target} y2={target} className={classes["target"]} />
      {ordered.map((curve) => (
        <path
          key={curve.trial_number}
          d={path(curve.points, scale, BOX)}
          className={curve.best ? classes["best"] : classes["earlier"]}
        />
      ))}
    </svg>
  );
}
