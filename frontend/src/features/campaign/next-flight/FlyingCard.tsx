import { Button, Stack } from "@mantine/core";
import { Link } from "wouter";
import type { Campaign, Trial } from "../../../api/types";
import { abortStage, abortText, isCutShort, useAbortControl } from "../../../live/flights";
import { useConnection, useIsOutputCurrent, useLiveFlight, useVehicleStatus } from "../../../live/store";
import { isSaturated, outputNow, readingOf, throttleNow } from "../../../live/telemetry";
import { isAfterRecord } from "../../../live/vehicleStatus";
import { withUnit } from "../../../ui/format";
import { GainList } from "../../../ui/gains";
import { LabelledValue } from "../../../ui/LabelledValue";
import { Note } from "../../../ui/Note";
import { Panel } from "../../../ui/Panel";
import { percentOrNothing } from "../../../ui/uncertainty";
import { useUnits } from "../../../ui/units";
import { FlightMarkers } from "../flights/FlightMarkers";
import { Predicted } from "./BeforeFlight";
import classes from "./NextFlight.module.css";
import { flyingStage, STAGED } from "./nextStep";

interface Props {
  campaign: Campaign;
  trials: readonly Trial[];
  flight: NonNullable<Campaign["flying"]>;
}

/** Live values of the flight in progress. The ABORT button is in the header of every page. */
export function FlyingCard({ campaign, trials, flight }: Props) {
  const { trial_id: trialId, trial_number: number } = flight;
  const trial = trials.find(({ id }) => id === trialId);
  const abort = useAbortControl();
  const { state, worker } = useConnection();
  const live = useLiveFlight(trialId);
  const unit = useUnits(campaign.definition.experiment).error;
  const reading = readingOf(live?.channel ?? "altitude_m");
  const { registered } = campaign.vehicle;
  const status = useVehicleStatus(registered ? campaign.vehicle.id : null);
  const aborting = abortStage(trialId, abort, status?.status.step);
  const isUnscored = isCutShort(aborting, status?.status.step);
  const stage = flyingStage(trial, live);
  const isAfter = isAfterRecord(status?.status.step);
  const hasOutput = isAfter || (live !== null && live.timeS.length > 0);
  const isStale = !useIsOutputCurrent(live, status) && hasOutput;
  return (
    <Panel
      title={`Flight ${number}: ${stage.toLowerCase()}`}
      tools={trial === undefined ? undefined : <FlightMarkers trial={trial} />}
    >
      <Stack gap={14}>
        <dl className={`${classes["values"]} ${classes["live"]}`}>
          <LabelledValue
            title={isStale ? `${reading.title}, last known` : reading.title}
            value={withUnit(outputNow(live, status), reading.unit, reading.digits)}
            stale={isStale}
          />
          <LabelledValue
            title={isUnscored ? "Error" : "Error so far"}
            value={isUnscored ? "not scored" : withUnit(live?.errorSoFar, unit)}
            stale={isStale}
          />
          <LabelledValue title="Predicted error" value={<Predicted trial={trial} unit={unit} />} />
          <LabelledValue title="Time" value={withUnit(live?.timeS.at(-1), "s", 1)} stale={isStale} />
          {live !== null && live.throttle !== null && (
            <LabelledValue
              title={isSaturated(live) && !isAfter ? "Throttle, saturated" : "Throttle"}
              value={percentOrNothing(throttleNow(live, status))}
              stale={isStale}
            />
          )}
        </dl>
        {trial && (
          <Note fz="body">
            <GainList gains={trial.gains} experiment={campaign.definition.experiment} />
            {trial.read_back && ", read back from the vehicle"}
          </Note>
        )}
        {registered && (
          <Button component={Link} to={`/fly/${trialId}`} size="lg">
            Open fly screen
          </Button>
        )}
        {stage !== STAGED && (
          <Note fz="body">{abortText(aborting, state === "live" && worker, status?.isCurrent === false)}</Note>
        )}
      </Stack>
    </Panel>
  );
}
