import { Button, Stack, Text } from "@mantine/core";
import { IconPencil, IconPlaneDeparture } from "@tabler/icons-react";
import { useState } from "react";
import { type RecordUpload, useCreateTrial, useFinish } from "../../api/mutations";
import { useStatistics } from "../../api/queries";
import type { Campaign, Proposal, Trial } from "../../api/types";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { useGainTitles, useUnits } from "../../ui/units";
import { FlightWindow } from "./FlightWindow";
import { GateChecks } from "./GateChecks";
import { ImportRecord } from "./ImportRecord";
import { ManualGains } from "./ManualGains";
import classes from "./NextFlight.module.css";
import { speedOf } from "./nextStep";
import { GainTable, PredictedError, ProposalExplanation, Recommendation } from "./ProposalDetails";
import { advised, type Choice, changesTo, choicesFor, expectationOf, KINDS, type Variant } from "./proposal";
import { SpeedSwitch, useSpeed } from "./SpeedSwitch";

interface Props {
  campaign: Campaign;
  proposal: Proposal;
  trials: readonly Trial[];
  upload: RecordUpload;
}

/** The proposed flight: recommendation, current and next gains, prediction, and a button that flies it. */
export function ProposalCard({ campaign, proposal, trials, upload }: Props) {
  const [editing, setEditing] = useState(false);
  const [speed, setSpeed] = useSpeed();
  const create = useCreateTrial(campaign);
  const experiment = campaign.definition.experiment ?? "";
  const units = useUnits(experiment);
  const titles = useGainTitles(experiment);
  const number = Math.max(0, ...trials.map((trial) => trial.number)) + 1;
  const { can_fly, needs_staging, registered } = campaign.vehicle;
  const order = can_fly && !needs_staging ? { fly: { speed: speedOf(speed) } } : {};
  const advice = advised(proposal);
  const flyVariant = (variant: Variant): void => create.mutate({ variant, ...order });
  if (editing) {
    return (
      <Panel title={`Flight ${number}, manual gains`}>
        <ManualGains
          campaign={campaign}
          start={proposal.gains}
          onClose={() => setEditing(false)}
          speed={speedOf(speed)}
        />
      </Panel>
    );
  }
  return (
    <Panel
      title={`Next flight: ${number}`}
      tools={
        <Text span c="dimmed" fz="body">
          {KINDS[proposal.kind]}
        </Text>
      }
    >
      <Stack gap={14}>
        {trials.length > 0 && <Recommendation advice={advice} />}
        {advice.variant !== null && (
          <>
            <GainTable changes={changesTo(advice.gains, proposal)} unit={units.gains} titles={titles} />
            <div>
              <FlyButton
                label={advice.variant === "repeat" ? "Repeat the best" : "Fly the baseline"}
                loading={create.isPending}
                onClick={() => advice.variant !== null && flyVariant(advice.variant)}
              />
              <Expectation campaignId={campaign.id} variant={advice.variant} />
            </div>
            <h3 className={classes["instead"]}>Or the proposed step</h3>
          </>
        )}
        <GainTable changes={proposal.changes} unit={units.gains} titles={titles} />
        <PredictedError proposal={proposal} best={campaign.best?.error ?? null} unit={units.error} />
        <FlightWindow definition={campaign.definition} />
        {can_fly ? (
          <>
            {!needs_staging && (
              <FlyButton
                label={flyLabel(advice.variant === null, proposal)}
                quiet={advice.variant !== null || advice.kind === "stop"}
                loading={create.isPending}
                disabled={!proposal.gate.passed}
                onClick={() => create.mutate({ proposal_id: proposal.id, ...order })}
              />
            )}
            {registered ? (
              <FlyButton
                label="Stage"
                quiet={!needs_staging || advice.variant !== null || advice.kind === "stop"}
                loading={create.isPending}
                disabled={!proposal.gate.passed}
                onClick={() => create.mutate({ proposal_id: proposal.id })}
              />
            ) : (
              <SpeedSwitch value={speed} onChange={setSpeed} />
            )}
          </>
        ) : (
          <ImportRecord upload={upload} proposalId={proposal.id} />
        )}
        <FlightAlternatives
          campaignId={campaign.id}
          choices={choicesFor(campaign, proposal, trials).filter(({ variant }) => variant !== advice.variant)}
          disabled={create.isPending}
          onFly={flyVariant}
          onEdit={() => setEditing(true)}
        />
        <ErrorNotice error={create.error} />
        <div>
          <ProposalExplanation explanation={proposal.explanation} unit={units.error} gains={proposal.gains} />
          <GateChecks gate={proposal.gate} />
        </div>
        {campaign.actions.includes("finish") && <StopCampaign campaignId={campaign.id} />}
      </Stack>
    </Panel>
  );
}

function flyLabel(recommended: boolean, { kind }: Proposal): string {
  if (kind === "manual") return "Fly these gains again";
  if (recommended) return "Fly next trial";
  return kind === "none" ? "Fly these gains" : "Fly the step";
}

interface FlyProps {
  label: string;
  loading: boolean;
  onClick: () => void;
  quiet?: boolean;
  disabled?: boolean;
}

function FlyButton({ label, loading, onClick, quiet = false, disabled = false }: FlyProps) {
  return (
    <Button
      fullWidth
      size="lg"
      variant={quiet ? "default" : "filled"}
      leftSection={<IconPlaneDeparture size={22} aria-hidden />}
      loading={loading}
      disabled={disabled}
      onClick={onClick}
    >
      {label}
    </Button>
  );
}

interface FlightAlternativesProps {
  campaignId: number;
  choices: readonly Choice[];
  disabled: boolean;
  onFly: (variant: Variant) => void;
  onEdit: () => void;
}

/** Alternatives to the proposal, each with its expected error. */
function FlightAlternatives({ campaignId, choices, disabled, onFly, onEdit }: FlightAlternativesProps) {
  return (
    <div className={classes["row"]}>
      {choices.map(({ variant, label, hint }) => (
        <div key={variant}>
          <Button fullWidth variant="default" title={hint} disabled={disabled} onClick={() => onFly(variant)}>
            {label}
          </Button>
          <Expectation campaignId={campaignId} variant={variant} />
        </div>
      ))}
      <Button variant="default" leftSection={<IconPencil size={18} aria-hidden />} onClick={onEdit}>
        Edit gains
      </Button>
    </div>
  );
}

/** One line below the button that flies the variant. */
function Expectation({ campaignId, variant }: { campaignId: number; variant: Variant }) {
  const expectation = expectationOf(variant, useStatistics(campaignId).data);
  return expectation === "" ? null : (
    <Note fz="fine" lh={1.35} m="6px 2px 4px" className="numbers">
      {expectation}
    </Note>
  );
}

/** Ends the campaign between flights, after a confirmation because planned trials are cancelled. */
function StopCampaign({ campaignId }: { campaignId: number }) {
  const [asking, setAsking] = useState(false);
  const finish = useFinish(campaignId);
  if (!asking) {
    return (
      <Button variant="subtle" color="gray" c="var(--dim)" onClick={() => setAsking(true)}>
        Stop campaign
      </Button>
    );
  }
  return (
    <Stack gap={14}>
      <Note fz="body">Stop this campaign? Its flights are kept, and it can be reopened.</Note>
      <div className={classes["row"]}>
        <Button variant="default" onClick={() => setAsking(false)}>
          Continue
        </Button>
        <Button color="red" loading={finish.isPending} onClick={() => finish.mutate()}>
          Stop campaign
        </Button>
      </div>
      <ErrorNotice error={finish.error} />
    </Stack>
  );
}
