import { Button, Stack } from "@mantine/core";
import { useMediaQuery } from "@mantine/hooks";
import { IconPlaneDeparture } from "@tabler/icons-react";
import { useReadOnlyReason } from "../../../api/access";
import type { RecordUpload } from "../../../api/mutations";
import { offersOf } from "../../../api/problems";
import { useStatistics } from "../../../api/queries";
import type { Campaign, Proposal, Trial } from "../../../api/types";
import { useConnection } from "../../../live/store";
import { flightsText } from "../../../ui/format";
import { sameHeld } from "../../../ui/gains";
import { Note } from "../../../ui/Note";
import { ErrorNotice, FormErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { useGainTitles, useHasModel, useUnits } from "../../../ui/units";
import { DeleteCampaign, StopCampaign } from "../EndCampaign";
import { ImportRecord } from "../flights/ImportRecord";
import { FlightWindow, GroundedNote, useGroundedReason } from "../next-flight/BeforeFlight";
import classes from "../next-flight/NextFlight.module.css";
import { SpeedSwitch } from "../next-flight/SpeedSwitch";
import { speedOf, useSpeed } from "../next-flight/speed";
import { isPriorScatter } from "../statistics/scatter";
import { isDoubtful, isRepeat, refusalOf, repeatSource } from "./choices";
import { FlightChoices } from "./FlightChoices";
import { GainTable } from "./GainTable";
import { GateChecks, GateRefusal, OverruleGate } from "./Gate";
import { PredictedError, ProposalExplanation, Reason } from "./ProposalDetails";
import { type ChosenFlight, type ShowPreview, useChosenFlight } from "./useChosenFlight";

/** The fly button is to be seen without scrolling: what explains the gains follows below it. */
const LOW = "(max-height: 920px)";
/** A tablet on its side. */
const LOW_AND_NARROW = "(max-width: 1200px) and (max-height: 860px)";
const AT_ONCE = { getInitialValueInEffect: false };

interface Props {
  campaign: Campaign;
  proposal: Proposal;
  trials: readonly Trial[];
  upload: RecordUpload;
  onPreview: ShowPreview;
  /** Whether another card has the next action. */
  isSecondary: boolean;
}

/** The next flight: one choice of gains, what is predicted for them, and the button that flies them. */
export function ProposalCard({ campaign, proposal, trials, upload, onPreview, isSecondary }: Props) {
  const isReadOnly = useReadOnlyReason(null) !== null;
  const chosen = useChosenFlight(campaign, proposal, onPreview, isReadOnly);
  const experiment = campaign.definition.experiment ?? "";
  const units = useUnits(experiment);
  const hasModel = useHasModel(experiment);
  const titles = useGainTitles(experiment);
  const number = Math.max(0, ...trials.map((trial) => trial.number)) + 1;
  const isEvaluated = chosen.gains !== null && chosen.error === null;
  const isRefused = chosen.isChecked && chosen.gate?.passed === false;
  const groups = useStatistics(campaign.id).data?.groups ?? [];
  const group = groups.find(({ gains }) => chosen.gains !== null && sameHeld(gains, chosen.gains));
  const present = Object.fromEntries(chosen.rows.map(({ name, now }) => [name, now]));
  const reference = groups.find(({ gains }) => sameHeld(gains, present));
  const isBestAgain = isRepeat(chosen.name) && group !== undefined && group === reference;
  const outside = groups.find(({ is_best }) => is_best);
  const isBestOutside = outside !== undefined && reference !== undefined && outside !== reference;
  const isCompact = useMediaQuery(LOW_AND_NARROW, undefined, AT_ONCE) ?? false;
  const isLow = useMediaQuery(LOW, undefined, AT_ONCE) ?? false;
  const isReasonLater = isLow && proposal.recommended !== "stop" && !isDoubtful(proposal);
  const reason = <Reason proposal={proposal} chosen={chosen.name} isFirst={trials.length === 0} />;
  const conditions = (
    <>
      {chosen.predicted?.interval && isEvaluated && isRepeat(chosen.name) && groups.length > 0 && (
        <PriorScatter campaignId={campaign.id} />
      )}
      <FlightWindow definition={campaign.definition} />
    </>
  );
  const isPredictionLater = isCompact && !hasModel;
  const prediction = isEvaluated && (
    <PredictedError
      predicted={chosen.predicted}
      isCurrent={chosen.isPredicted}
      best={isBestAgain ? null : (reference?.mean ?? null)}
      bestTitle={isBestOutside ? "the best in bounds" : "the best"}
      source={repeatSource(chosen.name, group)}
      unit={units.error}
      hasModel={hasModel}
    />
  );
  const isAnnounced = trials.length === 0 && chosen.choice?.recommended === true;
  return (
    <Panel title={`Next: flight ${number}`}>
      <Stack gap={isCompact ? 5 : 10} mod={{ compact: isCompact }} className={classes["proposal"] ?? ""}>
        <FlightChoices proposal={proposal} chosen={chosen.name} disabled={isReadOnly} onChoose={chosen.choose} />
        {!isReasonLater && reason}
        <GainTable
          rows={chosen.rows}
          from={campaign.best === null ? "Safe gains" : isBestOutside ? "Best in bounds" : "Best gains"}
          unit={units.gains}
          titles={titles}
          entry={chosen.entry}
        />
        {isBestOutside && (
          <Note>
            The best gains, of {flightsText(outside.trial_numbers)}, are outside the bounds. Steps and repeats use the
            best gains within them.
          </Note>
        )}
        {!isPredictionLater && prediction}
        {!isLow && conditions}
        <FormErrorNotice
          error={chosen.error}
          labels={chosen.entry ? Object.fromEntries(chosen.rows.map(({ name }) => [name, name])) : {}}
        />
        {isRefused && chosen.gate !== null && <Refusal chosen={chosen} problem={refusalOf(chosen.gate)} />}
        <FlightButtons
          campaign={campaign}
          proposal={proposal}
          chosen={chosen}
          number={number}
          upload={upload}
          isSecondary={isSecondary}
        />
        {isPredictionLater && prediction}
        {isReasonLater && reason}
        {isLow && conditions}
        <div>
          {chosen.choice?.proposed && (
            <ProposalExplanation
              explanation={proposal.explanation}
              said={isAnnounced ? "" : proposal.advice.why}
              unit={units.error}
              gains={proposal.gains}
            />
          )}
          {isEvaluated && !isRefused && <GateChecks gate={chosen.gate} isCurrent={chosen.isChecked} />}
        </div>
        {campaign.actions.includes("finish") && <StopCampaign campaignId={campaign.id} />}
        {campaign.actions.includes("delete") && <DeleteCampaign campaign={campaign} />}
      </Stack>
    </Panel>
  );
}

/** Names the source of a repeat's interval while no gain set has two valid flights. */
function PriorScatter({ campaignId }: { campaignId: number }) {
  const statistics = useStatistics(campaignId).data;
  if (statistics === undefined || !isPriorScatter(statistics)) return null;
  return <Note>The interval assumes the prior estimate of the scatter: no gain set has two valid flights.</Note>;
}

function Refusal({ chosen, problem }: { chosen: ChosenFlight; problem: ReturnType<typeof refusalOf> }) {
  const names = chosen.entry === undefined ? [] : chosen.rows.map(({ name }) => name);
  return (
    <GateRefusal
      problem={chosen.entry === undefined ? { ...problem, hint: "Select custom gains to fly others." } : problem}
      offers={names.flatMap((name) => offersOf(problem).filter(([gain]) => gain === name))}
      onUse={(offers) => chosen.use(Object.fromEntries(offers))}
    />
  );
}

interface ButtonsProps {
  campaign: Campaign;
  proposal: Proposal;
  chosen: ChosenFlight;
  number: number;
  upload: RecordUpload;
  isSecondary: boolean;
}

/** Flies exactly the gains shown, once these have been predicted and have passed the gate. */
function FlightButtons({ campaign, proposal, chosen, number, upload, isSecondary }: ButtonsProps) {
  const [speed, setSpeed] = useSpeed();
  const { worker } = useConnection();
  const { can_fly, id, is_real, needs_staging, registered } = campaign.vehicle;
  const isGrounded = useGroundedReason(id) !== "";
  const { trial, gate, isChecked, isPlanning } = chosen;
  const order = { fly: { speed: speedOf(speed) } };
  const isWarned = chosen.choice !== undefined && isDoubtful(proposal);
  const isAdvised = proposal.recommended !== "stop" && !isWarned && !isSecondary;
  const button = (label: string, isMain: boolean, onClick: () => void) => (
    <Button
      fullWidth
      size="lg"
      variant={isMain && isAdvised ? "filled" : "default"}
      leftSection={<IconPlaneDeparture size={22} aria-hidden />}
      loading={isPlanning}
      disabled={trial === undefined || !worker || (isMain && isGrounded)}
      onClick={onClick}
    >
      {label}
    </Button>
  );
  if (!can_fly) {
    return (
      <>
        <ImportRecord upload={upload} {...(trial === undefined ? {} : { plan: trial })} />
        <Button variant="default" loading={isPlanning} disabled={trial === undefined} onClick={chosen.plan}>
          Plan flight {number}
        </Button>
        <Note>Plan the flight to upload its record later.</Note>
        <ErrorNotice error={chosen.planError} />
      </>
    );
  }
  return (
    <>
      <GroundedNote vehicleId={id} />
      {!needs_staging && button(`Fly flight ${number}`, true, () => chosen.fly(order))}
      {registered ? (
        button("Open fly screen", needs_staging, chosen.plan)
      ) : (
        <SpeedSwitch value={speed} onChange={setSpeed} />
      )}
      {isChecked && gate?.passed === false && !is_real && (
        <OverruleGate
          pending={isPlanning}
          onFly={(overrule) => chosen.fly({ overrule, ...(needs_staging ? {} : order) })}
        />
      )}
      <ErrorNotice error={chosen.planError} />
    </>
  );
}
