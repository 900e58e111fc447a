import { Button, Chip, Group, Stack } from "@mantine/core";
import { IconPlaneDeparture } from "@tabler/icons-react";
import { useReadOnlyReason } from "../../../api/access";
import type { GainSet } from "../../../api/evaluation";
import type { RecordUpload } from "../../../api/mutations";
import { formProblem } from "../../../api/problems";
import { useStatistics } from "../../../api/queries";
import type { Campaign, CampaignStatistics, Proposal, Trial } from "../../../api/types";
import { useConnection } from "../../../live/store";
import { flightsText } from "../../../ui/format";
import { sameHeld } from "../../../ui/gains";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { useHasModel, useUnits } from "../../../ui/units";
import { DeleteCampaign, StopCampaign } from "../EndCampaign";
import { ImportRecord } from "../flights/ImportRecord";
import { FlightWindow, GroundedNote, useGroundedReason } from "../next-flight/BeforeFlight";
import { SpeedSwitch, useSpeed } from "../next-flight/speed";
import { isPriorScatter } from "../statistics/scatter";
import { CHOICES, type ChoiceName, isDoubtful, isRepeat, repeatSource } from "./choices";
import { GainTable } from "./GainTable";
import { GateChecks, GateRefusal, OverruleGate } from "./Gate";
import classes from "./Proposal.module.css";
import { PredictedError, ProposalDetails, Reason } from "./ProposalDetails";
import { type ChosenFlight, type ShowPreview, useChosenFlight } from "./useChosenFlight";

interface Props {
  campaign: Campaign;
  proposal: Proposal;
  trials: readonly Trial[];
  upload: RecordUpload;
  onPreview: ShowPreview;
  /** Whether another card has the next action. */
  isSecondary: boolean;
}

const NO_STATISTICS: Pick<CampaignStatistics, "groups" | "sigma"> = { groups: [], sigma: null };

/** The next flight: one choice of gains, what is predicted for them, and the button that flies them. */
export function ProposalCard({ campaign, proposal, trials, upload, onPreview, isSecondary }: Props) {
  const isReadOnly = useReadOnlyReason(null) !== null;
  const chosen = useChosenFlight(campaign, proposal, onPreview, isReadOnly);
  const { gains, gate, prediction, rows } = chosen;
  const experiment = campaign.definition.experiment;
  const units = useUnits(experiment);
  const hasModel = useHasModel(experiment);
  const number = Math.max(0, ...trials.map((trial) => trial.number)) + 1;
  const isEvaluated = gains !== null && chosen.error === null;
  const refusal = gate.isCurrent && gate.result?.passed === false ? gate.result : null;
  const statistics = useStatistics(campaign.id).data ?? NO_STATISTICS;
  const { groups } = statistics;
  const groupOf = (some: GainSet) => groups.find((group) => sameHeld(group.gains, some));
  const group = groupOf(gains ?? {});
  const reference = groupOf(Object.fromEntries(rows.map(({ name, now }) => [name, now])));
  const best = groups.find(({ is_best }) => is_best);
  const isBestOutside = best !== undefined && reference !== undefined && best !== reference;
  const labels = chosen.entry ? Object.fromEntries(rows.map(({ name }) => [name, name])) : {};
  const isAgain = isRepeat(chosen.name);
  const isAnnounced = trials.length === 0 && chosen.choice?.recommended === true;
  return (
    <Panel title={`Next: flight ${number}`}>
      <Stack gap={10} className={classes["next"]}>
        <FlightChoices proposal={proposal} chosen={chosen.name} disabled={isReadOnly} onChoose={chosen.choose} />
        <Reason proposal={proposal} chosen={chosen.name} isFirst={trials.length === 0} />
        <GainTable
          rows={rows}
          from={campaign.best === null ? "Safe gains" : isBestOutside ? "Best in bounds" : "Best gains"}
          unit={units.gains}
          entry={chosen.entry}
        />
        {isBestOutside && (
          <Note>
            The best gains, of {flightsText(best.trial_numbers)}, are outside the bounds. Steps and repeats use the best
            gains within them.
          </Note>
        )}
        {isEvaluated && (
          <PredictedError
            prediction={prediction}
            best={isAgain && group !== undefined && group === reference ? null : (reference?.mean ?? null)}
            bestTitle={isBestOutside ? "the best in bounds" : "the best"}
            source={repeatSource(chosen.name, group)}
            unit={units.error}
            hasModel={hasModel}
          />
        )}
        <Stack gap={10} className={classes["later"]}>
          {isEvaluated && prediction.result?.interval && isAgain && group && isPriorScatter(statistics) && (
            <Note>The interval assumes the prior estimate of the scatter: no gain set has two valid flights.</Note>
          )}
          <FlightWindow definition={campaign.definition} />
        </Stack>
        <ErrorNotice error={formProblem(chosen.error, labels)} shown={Object.keys(labels)} />
        {refusal && <GateRefusal gate={refusal} onUse={chosen.entry && chosen.use} />}
        <FlightButtons
          campaign={campaign}
          proposal={proposal}
          chosen={chosen}
          number={number}
          upload={upload}
          isSecondary={isSecondary}
        />
      </Stack>
      <Stack gap={10} mt={10}>
        <div>
          {chosen.choice?.proposed && (
            <ProposalDetails
              proposal={proposal}
              campaignId={campaign.id}
              said={isAnnounced ? "" : proposal.advice.why}
              unit={units.error}
              hasModel={hasModel}
            />
          )}
          {isEvaluated && !refusal && <GateChecks gate={gate.isCurrent ? gate.result : null} />}
        </div>
        {campaign.actions.includes("finish") && <StopCampaign campaignId={campaign.id} />}
        {campaign.actions.includes("delete") && <DeleteCampaign campaign={campaign} />}
      </Stack>
    </Panel>
  );
}

interface ChoicesProps {
  proposal: Proposal;
  chosen: ChoiceName;
  disabled: boolean;
  onChoose: (choice: ChoiceName) => void;
}

/** One choice of what to fly next. */
function FlightChoices({ proposal, chosen, disabled, onChoose }: ChoicesProps) {
  const recommended = proposal.choices.find(
    (choice) => choice.recommended && (!choice.proposed || proposal.gate.passed),
  )?.kind;
  return (
    <Chip.Group value={chosen} onChange={(name) => onChoose(name as ChoiceName)}>
      <Group gap={8} role="radiogroup" aria-label="Gains to fly">
        {[...proposal.choices.map(({ kind }) => kind), "own" as const].map((name) => (
          <Chip
            key={name}
            name="gains-to-fly"
            value={name}
            disabled={disabled}
            variant="outline"
            classNames={{ label: classes["choice"] }}
          >
            {CHOICES[name].label}
            {name === recommended && " (recommended)"}
          </Chip>
        ))}
      </Group>
    </Chip.Group>
  );
}

interface ButtonsProps extends Omit<Props, "trials" | "onPreview"> {
  chosen: ChosenFlight;
  number: number;
}

/** Flies exactly the gains shown, once these have been predicted and have passed the gate. */
function FlightButtons({ campaign, proposal, chosen, number, upload, isSecondary }: ButtonsProps) {
  const speed = useSpeed();
  const { worker } = useConnection();
  const { can_fly, id, is_real, needs_staging, registered } = campaign.vehicle;
  const isGrounded = useGroundedReason(id) !== "";
  const { trial, gate, planning } = chosen;
  const order = { fly: { speed } };
  const isWarned = chosen.choice !== undefined && isDoubtful(proposal);
  const isAdvised = proposal.recommended !== "stop" && !isWarned && !isSecondary;
  const button = (label: string, isMain: boolean, onClick: () => void) => (
    <Button
      fullWidth
      size="lg"
      variant={isMain && isAdvised ? "filled" : "default"}
      leftSection={<IconPlaneDeparture size={22} aria-hidden />}
      loading={planning.isPending}
      disabled={trial === undefined || !worker || (isMain && isGrounded)}
      onClick={onClick}
    >
      {label}
    </Button>
  );
  if (!can_fly) {
    return (
      <>
        <ImportRecord upload={upload} target={trial ? { plan: trial } : null} />
        <Button variant="default" loading={planning.isPending} disabled={trial === undefined} onClick={chosen.plan}>
          Plan flight {number}
        </Button>
        <Note>Plan the flight to upload its record later.</Note>
        <ErrorNotice error={planning.error} />
      </>
    );
  }
  return (
    <>
      <GroundedNote vehicleId={id} />
      {!needs_staging && button(`Fly flight ${number}`, true, () => chosen.fly(order))}
      {registered ? button("Open fly screen", needs_staging, chosen.plan) : <SpeedSwitch />}
      {gate.isCurrent && gate.result?.passed === false && !is_real && (
        <OverruleGate
          pending={planning.isPending}
          onFly={(overrule) => chosen.fly({ overrule, ...(needs_staging ? {} : order) })}
        />
      )}
      <ErrorNotice error={planning.error} />
    </>
  );
}
