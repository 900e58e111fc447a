import { Anchor, Button, Group, Loader, Stack, Text } from "@mantine/core";
import { IconAlertTriangle, IconPlaneDeparture, IconUpload } from "@tabler/icons-react";
import type { ReactNode } from "react";
import { Link } from "wouter";
import { useReadOnlyReason } from "../../api/access";
import { useFlyTrial } from "../../api/mutations";
import { useTrials } from "../../api/queries";
import type { Campaign, CheckItem, Trial, Vehicle } from "../../api/types";
import { useFlyActions } from "../../api/vehicleCommands";
import { type AbortControl, abortStage, abortText } from "../../live/flights";
import { useConnection, useVehicleStatus } from "../../live/store";
import { AbortButton } from "../../ui/AbortButton";
import { Aside } from "../../ui/Aside";
import { StateBadge } from "../../ui/Badges";
import { asSentence } from "../../ui/format";
import { sameHeld } from "../../ui/gains";
import { HoldButton } from "../../ui/HoldButton";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { trialStateLabel } from "../../ui/states";
import { FlightMarkers, PredictionResult } from "../campaign/flights/FlightMarkers";
import { FlightNotes } from "../campaign/flights/FlightNotes";
import { AbortCause, FlightReview } from "../campaign/flights/FlightReview";
import { FlightProblem } from "../campaign/next-flight/BeforeFlight";
import { wantsRehearsal } from "../campaign/next-flight/nextStep";
import { SpeedSwitch, useSpeed } from "../campaign/next-flight/speed";
import { sentenceOf } from "../campaign/verdict/verdict";
import { OperatorControl, useIsInControl } from "../fleet/OperatorControl";
import classes from "./Fly.module.css";
import { areReadBackSince, type FlyStep, isToldByVehicle, leftGainsText } from "./flyScreen";

interface Props {
  campaign: Campaign;
  trial: Trial;
  step: FlyStep;
  abort: AbortControl;
  isReady: boolean;
  /** Whether something must be put right first, as the stepper says. */
  isBlocked: boolean;
  /** Whether the vehicle has landed and gets its safe gains. */
  isLanded: boolean;
}

/** Actions of the current step for a vehicle with a link: control, staging, takeoff, review. */
export function LinkedSteps({
  campaign,
  trial,
  step,
  abort,
  isReady,
  isBlocked,
  isLanded,
  vehicle,
}: Props & { vehicle: Vehicle }) {
  switch (step) {
    case "plan":
      return <Plan campaign={campaign} trial={trial} vehicle={vehicle} isBlocked={isBlocked} />;
    case "staging":
      return (
        <Waiting text="Writing each gain and reading it back.">
          <Button variant="default" onClick={() => abort.press([trial.id])}>
            Cancel staging
          </Button>
        </Waiting>
      );
    case "staged":
      return <TakeOff trial={trial} vehicle={vehicle} isReady={isReady} />;
    case "unstaging":
      return <Waiting text="Writing the safe gains and reading them back. The flight is then planned again." />;
    case "flying":
      if (isLanded) return <Waiting text="Landed, motors off. Writing the safe gains and reading them back." />;
      return <Abort trial={trial} abort={abort} vehicle={vehicle} />;
    case "judge":
    case "over":
      return (
        <>
          <SafeGainsResult trial={trial} vehicle={vehicle} />
          <FlightReviewCard campaign={campaign} trial={trial} isTold={isToldByVehicle(trial, vehicle)} />
        </>
      );
  }
}

/** Whether the vehicle was left with its safe gains. */
function SafeGainsResult({ trial, vehicle }: { trial: Trial; vehicle: Vehicle }) {
  const { flight, flown_at } = trial;
  const status = useVehicleStatus(vehicle.id);
  if (flight === null || flown_at === null) return null;
  if (flight.safe_gains_restored === true) return <Note fz="small">Safe gains restored and read back.</Note>;
  const areReported = status?.isCurrent === true && sameHeld(status.status.held, vehicle.safe_gains);
  if (areReported || areReadBackSince(trial, vehicle)) {
    return (
      <Note fz="small">
        The safe gains were not confirmed at the end of the flight. The vehicle has reported them since.
      </Note>
    );
  }
  return (
    <Aside tone="warn" fz="small" role="alert">
      {leftGainsText(flight)}
    </Aside>
  );
}

/** Actions of the current step for a simulation without a link: one click flies. */
export function PlainSteps({ campaign, trial, step, abort, isBlocked }: Props) {
  const speed = useSpeed();
  const fly = useFlyTrial(campaign);
  switch (step) {
    case "plan":
      return (
        <Stack gap={12}>
          {campaign.vehicle.can_fly ? (
            <>
              <Button
                size="xl"
                leftSection={<IconPlaneDeparture size={24} aria-hidden />}
                loading={fly.isPending}
                disabled={!trial.actions.includes("fly") || isBlocked}
                onClick={() => fly.mutate({ trialId: trial.id, speed })}
              >
                Fly flight {trial.number}
              </Button>
              <SpeedSwitch />
            </>
          ) : (
            <Text fz="body" lh={1.4}>
              Gainline does not fly this vehicle.{" "}
              <Anchor component={Link} to={`/campaigns/${campaign.id}`}>
                Upload the flight record
              </Anchor>
            </Text>
          )}
          <FlightProblem flight={trial.flight} />
          <ErrorNotice error={fly.error} />
        </Stack>
      );
    case "judge":
    case "over":
      return <FlightReviewCard campaign={campaign} trial={trial} />;
    default:
      return <Abort trial={trial} abort={abort} vehicle={null} />;
  }
}

interface PlanProps {
  campaign: Campaign;
  trial: Trial;
  vehicle: Vehicle;
  isBlocked: boolean;
}

function Plan({ campaign, trial, vehicle, isBlocked }: PlanProps) {
  const { stage } = useFlyActions(vehicle.id);
  const isInControl = useIsInControl(vehicle);
  const isOthers = vehicle.control !== null && !isInControl;
  const wantsControl = isOthers || (vehicle.is_real && !isInControl);
  if (wantsRehearsal(campaign)) {
    return (
      <Text fz="body" lh={1.4}>
        {vehicle.name} is a real vehicle, and this campaign has not passed its rehearsal yet (
        {campaign.rehearsal.reason}).{" "}
        <Anchor component={Link} to={`/campaigns/${campaign.id}`}>
          Rehearse first
        </Anchor>
      </Text>
    );
  }
  const mayStage = vehicle.actions.includes("stage") && trial.actions.includes("stage") && !isBlocked;
  return (
    <Stack gap={12}>
      {(vehicle.is_real || isOthers || isInControl) && <OperatorControl vehicle={vehicle} />}
      {vehicle.state === "disconnected" && (
        <Anchor component={Link} to={`/vehicles/${vehicle.id}`} py={12}>
          Connect {vehicle.name}
        </Anchor>
      )}
      <FlightProblem flight={trial.flight} />
      <Button
        size="xl"
        leftSection={<IconUpload size={24} aria-hidden />}
        disabled={!mayStage || wantsControl}
        loading={stage.isPending}
        onClick={() => stage.mutate(trial)}
      >
        Stage gains
      </Button>
      <Note fz="small">
        {wantsControl
          ? "Take control first."
          : "Writes these gains to the landed, disarmed vehicle and reads each back. It does not move."}
      </Note>
      <PreflightChecks checks={vehicle.checks ?? []} />
      <ErrorNotice error={stage.error} />
    </Stack>
  );
}

/** The name without line breaks after its hyphens. */
function unbroken(name: string): string {
  return name.replaceAll("-", "-\u2060");
}

function TakeOff({ trial, vehicle, isReady }: { trial: Trial; vehicle: Vehicle; isReady: boolean }) {
  const { takeOff, unstage } = useFlyActions(vehicle.id);
  const isInControl = useIsInControl(vehicle);
  const isOthers = vehicle.control !== null && !isInControl;
  const may = isReady && trial.actions.includes("take-off");
  const isCurrent = useVehicleStatus(vehicle.id)?.isCurrent === true;
  return (
    <Stack gap={12}>
      {(vehicle.is_real || isOthers) && !isInControl && <OperatorControl vehicle={vehicle} />}
      {vehicle.is_real ? (
        <HoldButton
          label={`Hold to fly ${unbroken(vehicle.name)}`}
          disabled={!may || takeOff.isPending}
          onHeld={() => takeOff.mutate(trial)}
        />
      ) : (
        <Button
          size="xl"
          leftSection={<IconPlaneDeparture size={24} aria-hidden />}
          disabled={!may}
          loading={takeOff.isPending}
          onClick={() => takeOff.mutate(trial)}
        >
          Take off
        </Button>
      )}
      <Button
        variant="default"
        disabled={!trial.actions.includes("unstage") || !isCurrent}
        loading={unstage.isPending}
        onClick={() => unstage.mutate(trial)}
      >
        Unstage (restore safe gains)
      </Button>
      {!isCurrent && (
        <Note fz="small">The safe gains can be restored once data is received from the vehicle again.</Note>
      )}
      <ErrorNotice error={takeOff.error ?? unstage.error} />
    </Stack>
  );
}

/** `vehicle` is null for a simulation without a link. */
function Abort({ trial, abort, vehicle }: Pick<Props, "trial" | "abort"> & { vehicle: Vehicle | null }) {
  const status = useVehicleStatus(vehicle?.id ?? null);
  const stage = abortStage(trial.id, abort, status?.status.step);
  const { state, worker } = useConnection();
  return (
    <Stack gap={12}>
      <AbortButton trialId={trial.id} stage={stage} abort={abort} isLarge />
      <Note fz="small">{abortText(stage, state === "live" && worker, status?.isCurrent === false)}</Note>
    </Stack>
  );
}

function Waiting({ text, children }: { text: string; children?: ReactNode }) {
  return (
    <Stack gap={12}>
      <Group gap={14} mih={84} wrap="nowrap" lh={1.4}>
        <Loader size="sm" aria-hidden />
        {text}
      </Group>
      {children}
    </Stack>
  );
}

/** Failed preflight checks; renders nothing if all passed. */
function PreflightChecks({ checks }: { checks: readonly CheckItem[] }) {
  const failed = checks.filter(({ passed }) => !passed);
  if (failed.length === 0) return null;
  return (
    <Aside tone="warn" fz="small">
      <Stack component="ul" gap={8} className={classes["checks"]} aria-label="Failed preflight checks">
        {failed.map(({ name, title, found, needed, hint }) => (
          <li key={name}>
            <IconAlertTriangle size={18} color="var(--warn)" aria-hidden />
            <span>
              <strong>{title}</strong>: {found}, required {needed}.{hint && ` ${hint}`}
            </span>
          </li>
        ))}
      </Stack>
    </Aside>
  );
}

interface FlightReviewCardProps {
  campaign: Campaign;
  trial: Trial;
  /** Whether the page tells elsewhere how the flight ended: it is not repeated. */
  isTold?: boolean;
}

/** Result of the flight, its review, and the link to the next flight. */
function FlightReviewCard({ campaign, trial, isTold = false }: FlightReviewCardProps) {
  const trials = useTrials(campaign.id).data ?? [];
  const watching = useReadOnlyReason(campaign.vehicle);
  const page = `/campaigns/${campaign.id}`;
  return (
    <Stack gap={12}>
      <Group gap="4px 12px">
        <StateBadge words={trialStateLabel(trial.state)} />
        <PredictionResult trial={trial} />
        <FlightMarkers trial={trial} />
      </Group>
      {trial.state !== "captured" && !isTold && (
        <Text fz="body" lh={1.4}>
          {asSentence(sentenceOf(trial))}
        </Text>
      )}
      {watching === null && (
        <>
          <AbortCause trial={trial} />
          <Stack gap={8}>
            <FlightReview key={`${trial.id} ${trial.state}`} trial={trial} trials={trials} campaign={campaign} />
          </Stack>
          <FlightNotes trial={trial} />
        </>
      )}
      <Stack gap={0} align="center">
        {trial.state !== "captured" && trial.state !== "lost" && (
          <Button component={Link} to={page} size="lg" fullWidth>
            Next flight
          </Button>
        )}
        <Anchor component={Link} to={`${page}/flights/${trial.id}`} display="inline-block" py={12}>
          Open flight
        </Anchor>
      </Stack>
    </Stack>
  );
}
