import { Button, Stack } from "@mantine/core";
import { IconPlaneDeparture } from "@tabler/icons-react";
import { Link } from "react-router";
import { type RecordUpload, useCancelTrial, useFlyTrial } from "../../../api/mutations";
import type { Campaign, Trial } from "../../../api/types";
import { gainText, withUnit } from "../../../ui/format";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { intervalText } from "../../../ui/uncertainty";
import { useGainTitles, useUnits } from "../../../ui/units";
import { FlightMarkers } from "../flights/FlightMarkers";
import { ImportRecord } from "../flights/ImportRecord";
import { FlightProblem, FlightWindow, GroundedNote, useGroundedReason } from "./BeforeFlight";
import classes from "./NextFlight.module.css";
import { watched } from "./nextStep";
import { SpeedSwitch } from "./SpeedSwitch";
import { speedOf, useSpeed } from "./speed";

/** Letters of a gain's name, above which it needs a wider tile. */
const LONG = 8;

interface Props {
  campaign: Campaign;
  trial: Trial;
  upload: RecordUpload;
}

/** A planned trial: fly it, upload its record, or cancel it. */
export function PlannedCard({ campaign, trial, upload }: Props) {
  const [speed, setSpeed] = useSpeed();
  const experiment = campaign.definition.experiment ?? "";
  const unit = useUnits(experiment).error;
  const titles = useGainTitles(experiment);
  const fly = useFlyTrial(campaign);
  const cancel = useCancelTrial();
  const { can_fly, id, needs_staging, registered } = campaign.vehicle;
  const isLong = Object.keys(trial.gains).some((name) => name.length > LONG);
  const isGrounded = useGroundedReason(id) !== "";
  return (
    <Panel title={`Flight ${trial.number} is planned`} tools={<FlightMarkers trial={trial} />}>
      <Stack gap={14}>
        <dl className={`${classes["big"]} numbers`} data-long={isLong || undefined}>
          {Object.entries(trial.gains).map(([name, value]) => (
            <div key={name} className={classes["reading"]}>
              <dt>
                {name} {titles[name] && <small>{titles[name]}</small>}
              </dt>
              <dd title={String(value)}>{gainText(value)}</dd>
            </div>
          ))}
          {trial.predicted_error !== null && (
            <div className={classes["reading"]} data-row>
              <dt>Predicted error</dt>
              <dd>
                {withUnit(trial.predicted_error, unit)}{" "}
                {trial.predicted_interval && <small>{intervalText(trial.predicted_interval, unit)}</small>}
              </dd>
            </div>
          )}
        </dl>
        <FlightWindow definition={campaign.definition} />
        <FlightProblem flight={trial.flight} />
        {can_fly ? (
          <>
            <GroundedNote vehicleId={id} />
            {!needs_staging && (
              <Button
                size="lg"
                leftSection={<IconPlaneDeparture size={22} aria-hidden />}
                loading={fly.isPending}
                disabled={!trial.actions.includes("fly") || isGrounded}
                onClick={() => watched(fly.mutateAsync({ trialId: trial.id, speed: speedOf(speed) }))}
              >
                Fly flight {trial.number}
              </Button>
            )}
            {registered ? (
              <Button
                component={Link}
                to={`/fly/${trial.id}`}
                size="lg"
                variant={needs_staging ? "filled" : "default"}
                leftSection={<IconPlaneDeparture size={22} aria-hidden />}
              >
                Open fly screen
              </Button>
            ) : (
              <SpeedSwitch value={speed} onChange={setSpeed} />
            )}
          </>
        ) : (
          <ImportRecord upload={upload} trialId={trial.id} />
        )}
        <Button
          variant="default"
          loading={cancel.isPending}
          disabled={!trial.actions.includes("cancel")}
          onClick={() => cancel.mutate(trial.id)}
        >
          Cancel planned flight
        </Button>
        <ErrorNotice error={fly.error ?? cancel.error} />
      </Stack>
    </Panel>
  );
}
