import { Stack } from "@mantine/core";
import { IconCircleCheckFilled, IconCircleDashed } from "@tabler/icons-react";
import { useRef } from "react";
import type { Trial, Vehicle } from "../../api/types";
import { useIsCurrent } from "../../live/store";
import { isSaturated, type LiveFlight, outputNow, readingOf, throttleNow } from "../../live/telemetry";
import { type Aged, ageText, linkText, lowBattery } from "../../live/vehicleStatus";
import { gainText, NOTHING, withUnit } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { percentOrNothing } from "../../ui/uncertainty";
import classes from "./Fly.module.css";
import { type GainTick, gainTicks, secondsLeft } from "./flyScreen";

interface Props {
  trial: Trial;
  unit: string;
  live: LiveFlight | null;
  /** null for a vehicle without a permanent link. */
  status: Aged | null;
  /** null for a simulation without a link. */
  vehicle: Vehicle | null;
  isFlying: boolean;
  /** Whether the flight was aborted: its error is not scored from then on, and its record has no known end. */
  isAborted: boolean;
  /** Whether the record is complete, and the vehicle lands or has landed. */
  isRecordOver: boolean;
  /** Planned length of the record, s; null if unknown. */
  endS: number | null;
  /** Scored window, s; null if unknown. */
  windowS: number | null;
}

/** State of the link: its age, or why there is no data. */
function LinkReading({ status }: { status: Aged | null }) {
  if (status?.status.state === "gone" && status.linkAgeS !== null) {
    return <LabelledValue title="Link lost for" topic="linkAge" value={ageText(status.linkAgeS)} bad />;
  }
  if (status === null || status.status.state !== "connected") {
    return <LabelledValue title="Link" value={linkText(status)} bad />;
  }
  const title = status.isCurrent ? "Link age" : "No data for";
  return <LabelledValue title={title} topic="linkAge" value={ageText(status.linkAgeS)} bad={!status.isCurrent} />;
}

/** The value, or the last one that there was. */
function useLastKnown(value: number | null | undefined): number | null | undefined {
  const last = useRef(value);
  if (value !== null && value !== undefined) last.current = value;
  return last.current;
}

/** Large readings: altitude and error, then the rest. Stale readings are grey. */
export function Readouts({
  trial,
  unit,
  live,
  status,
  vehicle,
  isFlying,
  isAborted,
  isRecordOver,
  endS,
  windowS,
}: Props) {
  const hasLink = vehicle !== null;
  const reading = readingOf(live?.channel ?? "altitude_m");
  const linked = status?.status;
  const batteryV = linked?.batteryV ?? live?.batteryV;
  const low = vehicle === null ? "" : lowBattery(vehicle, batteryV);
  const isCurrent = useIsCurrent(live);
  const stale = hasLink ? !(status?.isCurrent ?? false) : isFlying && !isCurrent;
  const output = (isFlying ? outputNow(live, status) : null) ?? (reading.unit === "m" ? linked?.altitudeM : undefined);
  const lastOutput = useLastKnown(output);
  const hasThrottle = (useLastKnown(live?.throttle) ?? null) !== null;
  const isScored = isFlying && !isAborted && !isRecordOver;
  const saturated = live !== null && isScored && isSaturated(live);
  const error = isFlying ? live?.errorSoFar : trial.error;
  // The error so far is no mean over the scored window yet, as the predicted one is.
  const predicted =
    trial.predicted_error === null || isScored ? "" : ` · predicted ${withUnit(trial.predicted_error, unit)}`;
  return (
    <Stack gap={8} className={classes["readouts"] ?? ""}>
      <dl className={classes["row"]}>
        <LabelledValue
          title={stale ? `${reading.title}, last known` : reading.title}
          topic={reading.unit === "m" ? "altitude" : undefined}
          value={withUnit(stale ? lastOutput : output, reading.unit, reading.digits)}
          size="huge"
          stale={stale}
        />
        <LabelledValue
          title={`${isScored ? "Error so far" : "Error"}${predicted}`}
          topic={isScored ? "errorSoFar" : "error"}
          value={isFlying && isAborted ? "not scored" : withUnit(error, unit)}
          size="large"
          stale={isFlying && stale}
        />
      </dl>
      <dl className={classes["row"]}>
        {hasThrottle && live !== null && (
          <LabelledValue
            title={saturated ? "Saturated" : "Throttle"}
            topic="throttle"
            value={percentOrNothing(isFlying ? throttleNow(live, status) : null)}
            bad={saturated}
            stale={stale}
          />
        )}
        <LabelledValue
          title={low === "" ? "Battery" : `Battery, ${low}`}
          value={withUnit(batteryV, "V", 1)}
          stale={stale}
          bad={low !== "" && !stale}
        />
        {hasLink && <LinkReading status={status} />}
        {isScored && (
          <LabelledValue
            title="Ends in"
            value={withUnit(secondsLeft(live?.timeS.at(-1), endS), "s", 0)}
            stale={stale}
          />
        )}
        {!isFlying && (
          <LabelledValue
            title={trial.record === null ? "Scored window" : "Record length"}
            value={recordLength(trial, windowS)}
          />
        )}
      </dl>
    </Stack>
  );
}

/** Length of the record; before the flight that of its scored window. */
function recordLength({ flown_at, record }: Trial, plannedS: number | null): string {
  if (record !== null) return withUnit(record.duration_s, "s", 1);
  return flown_at === null ? withUnit(plannedS, "s", 1) : NOTHING;
}

interface HeldGainsProps {
  asked: Readonly<Record<string, number>>;
  readBack: Readonly<Record<string, number>> | null;
  held: Readonly<Record<string, number>>;
  titles: Readonly<Record<string, string>>;
  /** Whether the gains are staged; before that, none is marked as set. */
  areSet: boolean;
}

/** The gains of the flight, each ticked once it is read back. */
export function HeldGains({ asked, readBack, held, titles, areSet }: HeldGainsProps) {
  return (
    <table className={classes["gains"]}>
      <caption className="visually-hidden">Gains of this flight, and whether they are set</caption>
      <tbody>
        {gainTicks(asked, readBack, held).map((tick) => (
          <tr key={tick.name}>
            <th scope="row">
              {tick.name} <small>{titles[tick.name]}</small>
            </th>
            <td>{gainText(tick.asked)}</td>
            <td>
              <Tick {...tick} areSet={areSet} />
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Tick({ held, confirmed, areSet }: GainTick & Pick<HeldGainsProps, "areSet">) {
  if (areSet && confirmed) return <IconCircleCheckFilled size={22} color="var(--best)" aria-label="read back" />;
  const now = held === null ? "" : `now ${gainText(held)}`;
  return (
    <>
      <small>{areSet ? now || "not read" : now}</small>
      {areSet && <IconCircleDashed size={22} color="var(--edge)" aria-hidden />}
    </>
  );
}
