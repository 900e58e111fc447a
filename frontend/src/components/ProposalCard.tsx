import { Button } from "@mantine/core";
import { IconPencil, IconPlaneDeparture, IconRepeat } from "@tabler/icons-react";
import { useState } from "react";
import { type RecordUpload, useCreateTrial } from "../api/mutations";
import type { Campaign, Proposal, Trial } from "../api/types";
import { against, percentChange, withUnit } from "../lib/format";
import { bestOf, speedOf } from "../lib/nextStep";
import { GainTable } from "./GainTable";
import { ImportRecord } from "./ImportRecord";
import { ManualGains } from "./ManualGains";
import classes from "./NextFlight.module.css";
import { Panel } from "./Panel";
import { SpeedSwitch, useSpeed } from "./SpeedSwitch";
import { StopCampaign } from "./StopCampaign";
import { Trouble } from "./Trouble";
import { GateChecks, Why } from "./Why";

interface Props {
  campaign: Campaign;
  proposal: Proposal;
  trials: readonly Trial[];
  upload: RecordUpload;
}

const KINDS: Record<Proposal["kind"], string> = {
  start: "Start",
  step: "Step",
  manual: "By hand",
  "shorter step": "Shorter step",
  none: "Nothing better found",
};

/** The proposed flight: gains now and next, what it should bring and why, and one button that flies it. */
export function ProposalCard({ campaign, proposal, trials, upload }: Props) {
  const [editing, setEditing] = useState(false);
  const [speed, setSpeed] = useSpeed();
  const create = useCreateTrial(campaign.id);
  const number = Math.max(0, ...trials.map((trial) => trial.number)) + 1;
  const fly = { speed: speedOf(speed) };
  const best = bestOf(campaign, trials);
  if (editing) {
    return (
      <Panel title={`Flight ${number}, gains of your own`}>
        <ManualGains campaign={campaign} start={proposal.gains} onClose={() => setEditing(false)} speed={fly.speed} />
      </Panel>
    );
  }
  return (
    <Panel title={`Next flight: ${number}`} tools={<span className={classes["quiet"]}>{KINDS[proposal.kind]}</span>}>
      <div className={classes["stack"]}>
        {proposal.kind === "none" && <p className={classes["quiet"]}>{proposal.stop_verdict.sentence}</p>}
        <GainTable changes={proposal.changes} />
        <Predicted proposal={proposal} best={campaign.best?.error ?? null} />
        {campaign.vehicle.can_fly ? (
          <>
            <Button
              fullWidth
              size="lg"
              leftSection={<IconPlaneDeparture size={22} aria-hidden />}
              loading={create.isPending}
              disabled={!proposal.gate.passed}
              onClick={() => create.mutate({ proposal_id: proposal.id, fly })}
            >
              Fly next trial
            </Button>
            <SpeedSwitch value={speed} onChange={setSpeed} />
          </>
        ) : (
          <ImportRecord upload={upload} proposalId={proposal.id} />
        )}
        <Trouble error={create.error} />
        <div>
          <Why explanation={proposal.explanation} unit="m" />
          <GateChecks gate={proposal.gate} />
        </div>
        <div className={classes["row"]}>
          <Button variant="default" leftSection={<IconPencil size={18} aria-hidden />} onClick={() => setEditing(true)}>
            Edit gains
          </Button>
          <Button
            variant="default"
            leftSection={<IconRepeat size={18} aria-hidden />}
            disabled={best === null || create.isPending}
            title={
              best === null ? "There is no valid flight to repeat yet" : `Fly the gains of flight ${best.number} again`
            }
            onClick={() =>
              best !== null && create.mutate({ gains: best.gains, ...(campaign.vehicle.can_fly ? { fly } : {}) })
            }
          >
            Repeat best
          </Button>
        </div>
        {campaign.actions.includes("finish") && <StopCampaign campaignId={campaign.id} />}
      </div>
    </Panel>
  );
}

function Predicted({ proposal, best }: { proposal: Proposal; best: number | null }) {
  const change = percentChange(proposal.predicted_error, best);
  return (
    <div className={`${classes["predicted"]} numbers`}>
      <span>Predicted error</span>
      <span>
        <strong>{withUnit(proposal.predicted_error, "m")}</strong>
        {change !== null && <small>{against(change, "the best")}</small>}
      </span>
    </div>
  );
}
