import { Anchor, Box, Group, Stack, Text } from "@mantine/core";
import { useState } from "react";
import { Link } from "wouter";
import type { CampaignSummary } from "../../api/types";
import { Sparkline } from "../../charts/Sparkline";
import { StateBadge, VehicleBadge } from "../../ui/Badges";
import { count } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { Note } from "../../ui/Note";
import panel from "../../ui/Panel.module.css";
import { campaignStateLabel } from "../../ui/states";
import { plusMinus } from "../../ui/uncertainty";
import { useUnits } from "../../ui/units";
import { ArchiveCampaign } from "../campaign/EndCampaign";
import { CloneForm } from "../new-campaign/CloneForm";
import classes from "./CampaignCard.module.css";
import { progress } from "./campaignList";

/** A campaign in the list: result, curves, next action. */
export function CampaignCard({ campaign }: { campaign: CampaignSummary }) {
  const { id, name, vehicle, best, flights, next_action, spark } = campaign;
  const hasPassed = campaign.has_passed_as_rehearsal;
  const units = useUnits(campaign.experiment);
  return (
    <Stack component="li" gap={10} pos="relative" p="14px 16px 16px" className={`${panel["panel"]} ${classes["card"]}`}>
      <Group justify="space-between" gap={10} wrap="nowrap">
        <VehicleBadge isReal={vehicle.is_real} />
        <StateBadge words={campaignStateLabel({ ...campaign, hasPassed })} />
      </Group>
      <Text component="h2" fz="strong" fw={650} lh={1.3}>
        <Anchor component={Link} to={`/campaigns/${id}`} inherit c="inherit" underline="never">
          {name}
        </Anchor>
      </Text>
      <Note fz="small" mt={-6}>
        {vehicle.registered ? vehicle.name : vehicle.title}
      </Note>
      <Sparkline curves={spark} setPoint={units.setPoint} />
      <Stack component="dl" gap={4}>
        <LabelledValue
          title={(best?.standard_error ?? null) === null ? "Best error" : "Best error ± standard error"}
          value={plusMinus(best?.mean, best?.standard_error, units.error)}
        />
        <Group gap="0 12px" align="baseline" justify="space-between" lh={1.25}>
          <dt>{count(flights, "flight")}</dt>
          <Text
            component="dd"
            fz="small"
            fw={550}
            lh="inherit"
            c={campaign.verdict === "better" ? "var(--best)" : "dimmed"}
          >
            {progress(campaign)}
          </Text>
        </Group>
      </Stack>
      <Note fz="small" mt="auto" pt={10} className={classes["next"]}>
        {next_action}
      </Note>
      <More campaign={campaign} />
    </Stack>
  );
}

/** Actions on a campaign without opening it. */
function More({ campaign }: { campaign: CampaignSummary }) {
  const [open, setOpen] = useState(false);
  return (
    // Above the link that covers the card.
    <Box component="details" pos="relative" m="-6px 0 -10px" onToggle={(event) => setOpen(event.currentTarget.open)}>
      <Box component="summary" w="fit-content" fz="small" aria-label={`More actions for ${campaign.name}`}>
        {campaign.state === "finished" ? "Clone or archive" : "Clone"}
      </Box>
      {open && (
        <Stack gap={10} pb={12}>
          <CloneForm {...campaign} bestFlight={campaign.best?.trial_number ?? null} />
          {campaign.state === "finished" && <ArchiveCampaign campaignId={campaign.id} />}
        </Stack>
      )}
    </Box>
  );
}
