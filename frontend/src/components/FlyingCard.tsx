import type { Campaign, Trial } from "../api/types";
import { withUnit } from "../lib/format";
import { gainsInBrackets } from "../lib/gains";
import { useLiveFlight } from "../live/store";
import classes from "./NextFlight.module.css";
import { Panel } from "./Panel";

interface Props {
  campaign: Campaign;
  trial: Trial | undefined;
  step: { trialId: number; trialNumber: number };
}

function share(value: number | null | undefined): string {
  return value === null || value === undefined ? "–" : `${Math.round(100 * value)} %`;
}

/** What the flight under way says about itself. ABORT stands in the bar above, on every page. */
export function FlyingCard({ campaign, trial, step }: Props) {
  const live = useLiveFlight(step.trialId);
  const stage =
    live === null || live.timeS.length === 0
      ? trial?.state === "planned"
        ? "Waiting for the worker"
        : "Setting the gains"
      : "Flying";
  return (
    <Panel title={`Flight ${step.trialNumber}: ${stage.toLowerCase()}`}>
      <div className={classes["stack"]}>
        <dl className={`${classes["big"]} numbers`}>
          <div className={classes["reading"]} data-wide>
            <dt>Altitude</dt>
            <dd>{withUnit(live?.altitudeM.at(-1), "m", 2)}</dd>
          </div>
          <div className={classes["reading"]}>
            <dt>Error so far</dt>
            <dd>{withUnit(live?.errorSoFar, "m")}</dd>
          </div>
          <div className={classes["reading"]}>
            <dt>Predicted error</dt>
            <dd>{withUnit(trial?.predicted_error, "m")}</dd>
          </div>
          <div className={classes["reading"]}>
            <dt>Time</dt>
            <dd>{withUnit(live?.timeS.at(-1), "s", 1)}</dd>
          </div>
          <div className={classes["reading"]}>
            <dt>Thrust</dt>
            <dd>{share(live?.thrust)}</dd>
          </div>
        </dl>
        {trial && (
          <p className={`${classes["quiet"]} numbers`}>
            Gains {Object.keys(trial.gains).join(", ")} {gainsInBrackets(trial.gains)}
            {trial.read_back && ", read back from the vehicle"}.
          </p>
        )}
        <p className={classes["quiet"]}>
          ABORT above ends the flight at once and restores the safe gains
          {campaign.vehicle.is_real ? "." : "; so does the Space key."}
        </p>
      </div>
    </Panel>
  );
}
