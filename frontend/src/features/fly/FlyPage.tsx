import { Anchor, Group, Skeleton, Stack, Text, Title } from "@mantine/core";
import { IconAlertOctagonFilled, IconChevronLeft } from "@tabler/icons-react";
import { useMemo, useRef, useState } from "react";
import { Link, useParams } from "wouter";
import { useReadOnlyReason } from "../../api/access";
import { type TimeRange, useCampaign, useCampaignFigure, useCatalogue, useTrial } from "../../api/queries";
import type { Campaign, Trial, Vehicle } from "../../api/types";
import { useVehicleCommands } from "../../api/vehicleCommands";
import { useVehicle } from "../../api/vehicles";
import { Chart } from "../../charts/Chart";
import { type PlotlyFigure, wholeFlight, withChosen, withLimit, withTimeRange } from "../../charts/traces";
import { abortStage, isCutShort, useAbortControl } from "../../live/flights";
import { useReadiness } from "../../live/readiness";
import { useLiveFlight, useVehicleStatus } from "../../live/store";
import { hasLanded, type LiveFlight, readingOf } from "../../live/telemetry";
import { isAfterRecord, isDisarmed, isDown } from "../../live/vehicleStatus";
import { VehicleBadge } from "../../ui/Badges";
import { asSentence } from "../../ui/format";
import { NotFound, NotFoundPage } from "../../ui/NotFound";
import { ReadOnlyNotice } from "../../ui/Notices";
import panel from "../../ui/Panel.module.css";
import { useGainTitles, useUnits } from "../../ui/units";
import { useTitle } from "../../ui/useTitle";
import { windowOf } from "../campaign/campaignSettings";
import fleet from "../fleet/Fleet.module.css";
import { CommandResult, LandNow, MotorsOff } from "../fleet/QuarantinePanel";
import classes from "./Fly.module.css";
import { type FlyStep, flyStateLabel, flyStep, gainsShown, isAirborneStep } from "./flyScreen";
import { ReadinessLosses, ReadinessStepper } from "./ReadinessStepper";
import { HeldGains, Readouts } from "./Readouts";
import { LinkedSteps, PlainSteps } from "./Steps";

export function FlyPage() {
  const trialId = Number(useParams()["trialId"]);
  return Number.isInteger(trialId) ? <FlyTrial key={trialId} trialId={trialId} /> : <NotFoundPage />;
}

function FlyTrial({ trialId }: { trialId: number }) {
  const trial = useTrial(trialId);
  const campaign = useCampaign(trial.data?.campaign_id ?? null);
  const { registered = false, id = null } = campaign.data?.vehicle ?? {};
  const vehicle = useVehicle(registered ? id : null);
  useTitle(trial.data ? `Fly flight ${trial.data.number}` : "Fly");
  const error = trial.data ? campaign.error : trial.error;
  if (error) return <NotFound error={error} />;
  if (trial.data === undefined || campaign.data === undefined || (registered && vehicle === null)) {
    return <Skeleton height={480} radius="md" />;
  }
  return <Screen campaign={campaign.data} trial={trial.data} vehicle={vehicle} />;
}

interface Props {
  campaign: Campaign;
  trial: Trial;
  vehicle: Vehicle | null;
}

/** Steps without actions in a quarantine or with read-only access. */
const BARRED: readonly FlyStep[] = ["plan", "staging", "staged", "unstaging"];

/** All readings and actions to stage, fly and review a flight. */
function Screen({ campaign, trial, vehicle }: Props) {
  const abort = useAbortControl();
  const live = useLiveFlight(trial.id);
  const status = useVehicleStatus(vehicle?.id ?? null);
  const orders = useVehicleCommands(vehicle?.id ?? 0);
  const experiment = campaign.definition.experiment ?? "takeoff";
  const unit = useUnits(experiment).error;
  const titles = useGainTitles(experiment);
  const windowS = windowOf(campaign.definition, useCatalogue().data);
  const { figure, summary } = useTakeoffs(trial, groundOf(live));
  const step = flyStep(trial, live?.phase ?? null);
  const concern = status?.status.concern || vehicle?.concern || "";
  const quarantined = vehicle !== null && (vehicle.state === "quarantined" || (status?.status.concern ?? "") !== "");
  const readiness = useReadiness(trial.id, vehicle?.id ?? null);
  const isReady = readiness?.is_ready ?? false;
  const isHeld = readiness?.steps.includes("staged") === true;
  const flightId = trial.flight?.id ?? null;
  const wasAirborne = useLatched(flightId, isAirborneStep(status?.status.step));
  const hasLostLink = useLatched(flightId, status?.status.step === "link lost");
  const { word, tone } = flyStateLabel(trial, step, status, {
    quarantined,
    readiness,
    hasFlown: wasAirborne || hasLanded(live?.phase),
    hasLostLink,
    isStopped: orders.said?.order === "motors off" && orders.said.accepted,
  });
  const isFlying = step === "flying";
  const vehicleStep = status?.status.step;
  const isAborting = isCutShort(abortStage(trial.id, abort, vehicleStep), vehicleStep);
  const isAborted = useLatched(flightId, isFlying && isAborting);
  const isLanded = isFlying && isDown(status, (live?.timeS.length ?? 0) > 0);
  const watching = useReadOnlyReason(vehicle);
  const barred = BARRED.includes(step) && (quarantined || watching !== null);
  const steps = {
    campaign,
    trial,
    step,
    abort,
    isReady,
    isLanded,
    isBlocked: readiness?.losses.some(({ kind }) => kind !== "gains unknown") === true,
  };
  return (
    <div className={classes["screen"]} data-step={step}>
      <div className={classes["head"]}>
        <Anchor component={Link} to={`/campaigns/${campaign.id}`} fz="body" className={classes["back"]}>
          <IconChevronLeft size={20} aria-hidden />
          <Text span inherit truncate>
            Flight {trial.number} · {campaign.name}
          </Text>
        </Anchor>
        <Title flex={1} lh={1.15} c="var(--tone)" className={classes["word"] ?? ""} data-tone={tone}>
          {word}
        </Title>
        <p className="visually-hidden" role="status">
          Flight {trial.number}: {word}
        </p>
        {readiness !== null && (
          <ReadinessStepper
            readiness={readiness}
            needsOperator={vehicle !== null && (vehicle.is_real || vehicle.control !== null)}
          />
        )}
        {vehicle === null && <VehicleBadge isReal={campaign.vehicle.is_real} title={campaign.vehicle.title} />}
      </div>
      <Readouts
        trial={trial}
        unit={unit}
        live={live}
        status={status}
        vehicle={vehicle}
        isFlying={isFlying}
        isAborted={isAborted}
        isRecordOver={isLanded || isAfterRecord(status?.status.step)}
        windowS={windowS}
        endS={figure === null ? null : (wholeFlight(figure)?.[1] ?? null)}
      />
      <div className={`${panel["panel"]} ${classes["chart"]}`}>
        {figure !== null && (
          <Chart
            figure={figure}
            label={`Live curve. ${summary}`}
            height={null}
            liveTrial={isFlying ? trial.id : null}
          />
        )}
      </div>
      <section className={`${panel["panel"]} ${classes["steps"]}`} aria-label="Next action">
        {readiness !== null && (
          <ReadinessLosses losses={readiness.losses.filter(({ kind }) => !quarantined || kind !== "quarantined")} />
        )}
        <ReadOnlyNotice why={vehicle === null ? null : watching} />
        {quarantined && vehicle !== null && (
          <Quarantine vehicle={vehicle} concern={concern} isDown={isDisarmed(status)} orders={orders} />
        )}
        {!barred && (vehicle === null ? <PlainSteps {...steps} /> : <LinkedSteps {...steps} vehicle={vehicle} />)}
        <HeldGains
          asked={trial.gains}
          titles={titles}
          {...gainsShown(step, {
            isHeld,
            readBack: trial.read_back,
            reported: status?.isCurrent ? status.status.held : {},
          })}
        />
      </section>
      {vehicle !== null && <MotorsOff vehicle={vehicle} status={status} orders={orders} watching={watching !== null} />}
    </div>
  );
}

/** Whether something was seen of this flight while the page watched: its later steps on the ground do not tell. */
function useLatched(flightId: number | null, isSeen: boolean): boolean {
  const seen = useRef<number | null>(null);
  if (isSeen) seen.current = flightId;
  return flightId !== null && seen.current === flightId;
}

/** Altitude of the ground where the vehicle stood at the command, to 0.1 m: the altitude limit counts from it. */
function groundOf(live: LiveFlight | null): number {
  const [firstM = 0] = live?.measured ?? [];
  return live !== null && readingOf(live.channel).unit === "m" ? Math.round(10 * firstM) / 10 : 0;
}

/** Its curve beside the earlier ones, over all of its time. */
function useTakeoffs({ campaign_id, number }: Trial, groundM: number) {
  const [window, setWindow] = useState<TimeRange | null>(null);
  const card = useCampaignFigure(campaign_id, "takeoffs", { window, predicted: number }).data;
  const raw = card?.figure as PlotlyFigure | null | undefined;
  const whole = raw ? wholeFlight(raw) : null;
  if (whole !== null && whole.join() !== window?.join()) setWindow(whole);
  const figure = useMemo(() => {
    if (!raw) return null;
    const { data, layout } = withLimit(raw, groundM);
    return { data: withChosen(data, number), layout: withTimeRange(layout, wholeFlight(raw)) };
  }, [raw, number, groundM]);
  return { figure, summary: card?.summary ?? "" };
}

interface QuarantineProps {
  vehicle: Vehicle;
  concern: string;
  isDown: boolean;
  orders: ReturnType<typeof useVehicleCommands>;
}

/** Reason of the quarantine, the Land command, and a link to the release. */
function Quarantine({ vehicle, concern, isDown, orders }: QuarantineProps) {
  return (
    <Stack gap={10} p="12px 14px" className={fleet["quarantine"] ?? ""}>
      <div role="alert">
        <Group gap={8} c="var(--bad)">
          <IconAlertOctagonFilled size={24} aria-hidden />
          <Title order={2} fz="title">
            Do not fly
          </Title>
        </Group>
        <Text mt={4} lh={1.4}>
          {asSentence(concern)}
        </Text>
      </div>
      <LandNow isDown={isDown} orders={orders} />
      {orders.said?.order === "land" && <CommandResult orders={orders} isDown={isDown} />}
      <Anchor component={Link} to={`/vehicles/${vehicle.id}`} display="inline-block" py={12}>
        Inspect and release {vehicle.name}
      </Anchor>
    </Stack>
  );
}
