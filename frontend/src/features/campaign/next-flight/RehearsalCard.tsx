import { Anchor, Button, Stack } from "@mantine/core";
import { Link } from "wouter";
import { useRehearse } from "../../../api/mutations";
import type { Campaign } from "../../../api/types";
import { Aside } from "../../../ui/Aside";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { useHasModel } from "../../../ui/units";
import { openCampaign } from "../../new-campaign/newCampaign";
import page from "../CampaignPage.module.css";

/** Next action of a real vehicle's campaign that has not passed its rehearsal. */
export function RehearsalCard({ campaign }: { campaign: Campaign }) {
  const rehearse = useRehearse(campaign.id);
  const hasModel = useHasModel(campaign.definition.experiment);
  const { state, campaign_id, reason } = campaign.rehearsal;
  return (
    <Panel title="Rehearse first">
      <Stack gap={14}>
        <Note fz="body">
          {campaign.vehicle.name} is a real vehicle. Before its first flight, the campaign must pass a rehearsal on a
          simulation with the same strategy, bounds, stop rule and gains: three valid flights (fewer if the stop rule
          ends it), none aborted, invalid or lost, and none with gains that the gate refuses.
          {!hasModel &&
            " It flies on a registered simulated drone with the same autopilot (gainline sim-drone): register and connect it first."}
        </Note>
        <p role="status">
          <strong>{STANDING[state]}</strong> {reason}.
        </p>
        {state === "under way" && campaign_id !== null ? (
          <Button component={Link} to={`/campaigns/${campaign_id}`} fullWidth>
            Continue rehearsal
          </Button>
        ) : (
          <Button
            fullWidth
            loading={rehearse.isPending}
            onClick={() => rehearse.mutate(undefined, { onSuccess: openCampaign })}
          >
            Rehearse on a simulation
          </Button>
        )}
        {state === "failed" && campaign_id !== null && (
          <Anchor component={Link} to={`/campaigns/${campaign_id}`} py={12} display="inline-block">
            Open failed rehearsal
          </Anchor>
        )}
        <ErrorNotice error={rehearse.error} />
      </Stack>
    </Panel>
  );
}

const STANDING: Partial<Record<Campaign["rehearsal"]["state"], string>> = {
  missing: "Not passed yet:",
  "under way": "In progress:",
  failed: "Failed:",
};

/** Note on a rehearsal's page, with the way to the real campaign: the next action once the rehearsal has passed. */
export function RehearsalNote({ real }: { real: Campaign }) {
  if (real.rehearsal.state === "passed") {
    return (
      <Panel title="Rehearsal passed">
        <Button component={Link} to={`/campaigns/${real.id}`} fullWidth size="lg" className={page["wrapping"]}>
          Open {real.name}
        </Button>
      </Panel>
    );
  }
  return (
    <Aside tone="good" fz="small">
      <strong>This is a rehearsal</strong>
      <p>
        It must pass before the real vehicle can fly:{" "}
        <Anchor component={Link} to={`/campaigns/${real.id}`} inherit>
          {real.name}
        </Anchor>
      </p>
    </Aside>
  );
}
