import { Button, Stack } from "@mantine/core";
import { IconPlaneDeparture } from "@tabler/icons-react";
import { Link } from "wouter";
import { type RecordUpload, useCancelTrial, useFlyTrial } from "../../../api/mutations";
import type { Campaign, Trial } from "../../../api/types";
import { gainText } from "../../../ui/format";
import { LabelledValue } from "../../../ui/LabelledValue";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { useGainTitles, useUnits } from "../../../ui/units";
import { FlightMarkers } from "../flights/FlightMarkers";
import { ImportRecord } from "../flights/ImportRecord";
import { FlightProblem, FlightWindow, GroundedNote, Predicted, useGroundedReason } from "./BeforeFlight";
import classes from "./NextFlight.module.css";
import { scrollUpOnceBegun } from "./nextStep";
import { SpeedSwitch, useSpeed } from "./speed";

interface Props {
  campaign: Campaign;
  trial: Trial;
  upload: RecordUpload;
}

/** A planned trial: fly it, upload its record, or cancel it. */
export function PlannedCard({ campaign, trial, upload }: Props) {
  const speed = useSpeed();
  const experiment = campaign.definition.experiment;
  const unit = useUnits(experiment).error;
  const titles = useGainTitles(experiment);
  const fly = useFlyTrial(campaign);
  const cancel = useCancelTrial();
  const { can_fly, id, needs_staging, registered } = campaign.vehicle;
  const isGrounded = useGroundedReason(id) !== "";
  return (
    <Panel title={`Flight ${trial.number} is planned`} tools={<FlightMarkers trial={trial} />}>
      <Stack gap={14}>
        <dl className={classes["values"]}>
          {Object.entries(trial.gains).map(([name, value]) => (
            <LabelledValue
              key={name}
              title={
                <>
                  {name} <small>{titles[name]}</small>
                </>
              }
              value={<span title={String(value)}>{gainText(value)}</span>}
            />
          ))}
        </dl>
        {trial.predicted_error !== null && (
          <dl className={classes["values"]}>
            <LabelledValue title="Predicted error" value={<Predicted trial={trial} unit={unit} />} />
          </dl>
        )}
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
                onClick={() => scrollUpOnceBegun(fly.mutateAsync({ trialId: trial.id, speed }))}
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
              <SpeedSwitch />
            )}
          </>
        ) : (
          <ImportRecord upload={upload} target={{ trialId: trial.id }} />
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
