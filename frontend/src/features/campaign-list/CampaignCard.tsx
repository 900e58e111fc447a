import { Stack } from "@mantine/core";
import { useState } from "react";
import { Link } from "react-router";
import type { CampaignSummary } from "../../api/types";
import { Sparkline } from "../../charts/Sparkline";
import { StateBadge, VehicleBadge } from "../../ui/Badges";
import { count } from "../../ui/format";
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
    <li className={classes["card"]}>
      <div className={classes["top"]}>
        <VehicleBadge isReal={vehicle.is_real} />
        <StateBadge words={campaignStateLabel({ ...campaign, hasPassed })} />
      </div>
      <h2 className={classes["name"]}>
        <Link to={`/campaigns/${id}`}>{name}</Link>
      </h2>
      <p className={classes["vehicle"]}>{vehicle.registered ? vehicle.name : vehicle.title}</p>
      <Sparkline curves={spark} setPoint={units.setPoint} />
      <dl className={`${classes["figures"]} numbers`}>
        <div>
          <dt>{(best?.standard_error ?? null) === null ? "Best error" : "Best error ± standard error"}</dt>
          <dd>{plusMinus(best?.mean, best?.standard_error, units.error)}</dd>
        </div>
        <div>
          <dt>{count(flights, "flight")}</dt>
          <dd className={classes["progress"]} data-better={campaign.verdict === "better" || undefined}>
            {progress(campaign) ?? " "}
          </dd>
        </div>
      </dl>
      <p className={classes["next"]}>{next_action}</p>
      <More campaign={campaign} />
    </li>
  );
}

/** Actions on a campaign without opening it. */
function More({ campaign }: { campaign: CampaignSummary }) {
  const [open, setOpen] = useState(false);
  return (
    <details className={classes["more"]} onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary aria-label={`More actions for ${campaign.name}`}>
        {campaign.state === "finished" ? "Clone or archive" : "Clone"}
      </summary>
      {open && (
        <Stack gap={10} pb={12}>
          <CloneForm {...campaign} bestFlight={campaign.best?.trial_number ?? null} />
          {campaign.state === "finished" && <ArchiveCampaign campaignId={campaign.id} />}
        </Stack>
      )}
    </details>
  );
}
