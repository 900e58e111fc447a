import type { Trial } from "../../api/types";
import { secondsLeft, thrustText } from "../../lib/flyScreen";
import { withUnit } from "../../lib/format";
import { type LiveFlight, readingOf } from "../../lib/live";
import { predictedText } from "../../lib/uncertainty";
import { type Aged, linkText } from "../../lib/vehicle";
import classes from "./Fly.module.css";

interface Props {
  trial: Trial;
  unit: string;
  live: LiveFlight | null;
  /** null for a vehicle that keeps no link. */
  status: Aged | null;
  hasLink: boolean;
  isFlying: boolean;
  endS: number | null;
}

interface ReadingProps {
  title: string;
  value: string;
  size?: "huge" | "large" | "usual";
  stale?: boolean;
  bad?: boolean;
}

function Reading({ title, value, size = "usual", stale = false, bad = false }: ReadingProps) {
  return (
    <div className={classes["reading"]} data-size={size} data-stale={stale || undefined} data-bad={bad || undefined}>
      <dt>{title}</dt>
      <dd>{value}</dd>
    </div>
  );
}

/** What can be read from arm's length: altitude and error so far, then the rest. Grey is what is no longer so. */
export function Readouts({ trial, unit, live, status, hasLink, isFlying, endS }: Props) {
  const reading = readingOf(live?.channel ?? "altitude_m");
  const measured = isFlying ? live?.measured.at(-1) : undefined;
  const linked = status?.status;
  const stale = hasLink && !(status?.isCurrent ?? false);
  const output = measured ?? (reading.unit === "m" ? linked?.altitudeM : undefined);
  const left = isFlying ? secondsLeft(live?.timeS.at(-1), endS) : null;
  const error = isFlying ? live?.errorSoFar : (trial.error ?? live?.errorSoFar);
  const batteryV = linked?.batteryV ?? live?.batteryV;
  return (
    <dl className={`${classes["readouts"]} numbers`}>
      <Reading
        title={stale ? `${reading.title}, as last heard` : reading.title}
        value={withUnit(output, reading.unit, reading.digits)}
        size="huge"
        stale={stale}
      />
      <Reading
        title={trial.error !== null && !isFlying ? "Error" : "Error so far"}
        value={withUnit(error, unit)}
        size="large"
      />
      <Reading title="Predicted error" value={predictedText(trial.predicted_error, null, unit)} />
      {live?.thrust !== null && live !== null && <Reading title="Thrust" value={thrustText(live.thrust)} />}
      <Reading title="Battery" value={withUnit(batteryV, "V", 1)} stale={stale} />
      {hasLink && <Reading title="Link" value={linkText(status)} bad={stale} />}
      <Reading title="Record ends in" value={withUnit(left, "s", 0)} />
    </dl>
  );
}
