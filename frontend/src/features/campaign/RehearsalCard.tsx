import { Anchor, Button } from "@mantine/core";
import { Link, useNavigate } from "react-router";
import { useRehearse } from "../../api/mutations";
import { useCampaign } from "../../api/queries";
import type { Campaign } from "../../api/types";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { Panel } from "../../ui/Panel";
import classes from "./NextFlight.module.css";

/** The one thing to do with a campaign on a real vehicle that has not flown on a simulation. */
export function RehearsalCard({ campaign }: { campaign: Campaign }) {
  const navigate = useNavigate();
  const rehearse = useRehearse(campaign.id);
  const { state, campaign_id, reason } = campaign.rehearsal;
  return (
    <Panel title="Rehearse first">
      <div className={classes["stack"]}>
        <p className={classes["quiet"]}>
          {campaign.vehicle.name} is a real vehicle. Before its first flight the whole campaign is flown on a
          simulation, with the same strategy, bounds, stop rule and gains: three valid flights, or up to its stop, and
          none aborted or invalid.
        </p>
        <p role="status">
          <strong>{STANDING[state]}</strong> {reason}.
        </p>
        {state === "under way" && campaign_id !== null ? (
          <Button component={Link} to={`/campaigns/${campaign_id}`} fullWidth>
            Go on with the rehearsal
          </Button>
        ) : (
          <Button
            fullWidth
            loading={rehearse.isPending}
            onClick={() => rehearse.mutate(undefined, { onSuccess: ({ id }) => void navigate(`/campaigns/${id}`) })}
          >
            Rehearse on the simulation
          </Button>
        )}
        {state === "failed" && campaign_id !== null && (
          <Anchor component={Link} to={`/campaigns/${campaign_id}`} className={classes["link"]}>
            Look at the rehearsal that failed
          </Anchor>
        )}
        <ErrorNotice error={rehearse.error} />
      </div>
    </Panel>
  );
}

const STANDING: Partial<Record<Campaign["rehearsal"]["state"], string>> = {
  missing: "Not rehearsed yet:",
  "under way": "Under way:",
  failed: "It failed:",
};

/** On a rehearsal's own page: what it is for, and the way back. */
export function RehearsalNote({ campaignId }: { campaignId: number }) {
  const real = useCampaign(campaignId).data;
  if (real === undefined) return null;
  const passed = real.rehearsal.state === "passed";
  return (
    <div className={classes["advice"]}>
      <p>
        <strong>{passed ? "The rehearsal has passed" : "This is a rehearsal"}</strong>
        <span>
          {passed ? "Now fly it for real: " : "The real campaign waits for it: "}
          <Anchor component={Link} to={`/campaigns/${campaignId}`}>
            {real.name} on {real.vehicle.name}
          </Anchor>
        </span>
      </p>
    </div>
  );
}
