import { Link } from "react-router";
import type { CampaignSummary } from "../api/types";
import { progress } from "../lib/campaigns";
import { count } from "../lib/format";
import { campaignWords } from "../lib/states";
import { plusMinus } from "../lib/uncertainty";
import classes from "./CampaignCard.module.css";
import { Sparkline } from "./Sparkline";
import { StateBadge } from "./StateBadge";
import { useUnits } from "./useUnits";
import { VehicleBadge } from "./VehicleBadge";

/** A campaign at a glance: what it reached, how its curves look, what to do next. */
export function CampaignCard({ campaign }: { campaign: CampaignSummary }) {
  const { id, name, state, outcome, vehicle, best, flights, next_action, spark } = campaign;
  const unit = useUnits(campaign.experiment).error;
  return (
    <li className={classes["card"]}>
      <div className={classes["top"]}>
        <VehicleBadge isReal={vehicle.is_real} />
        <StateBadge words={campaignWords(state, outcome)} />
      </div>
      <h2 className={classes["name"]}>
        <Link to={`/campaigns/${id}`}>{name}</Link>
      </h2>
      <p className={classes["vehicle"]}>{vehicle.title}</p>
      <Sparkline curves={spark} />
      <dl className={`${classes["figures"]} numbers`}>
        <div>
          <dt>{best === null ? "Best error" : "Best error ± standard error"}</dt>
          <dd>{plusMinus(best?.mean, best?.standard_error, unit)}</dd>
        </div>
        <div>
          <dt>{count(flights, "flight")}</dt>
          <dd className={classes["progress"]} data-better={campaign.verdict === "better" || undefined}>
            {progress(campaign) ?? " "}
          </dd>
        </div>
      </dl>
      <p className={classes["next"]}>{next_action}</p>
    </li>
  );
}
