import { Anchor, Button } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { Link } from "react-router";
import { recordCsv } from "../api/queries";
import type { Trial } from "../api/types";
import { gainText, percentChange, withUnit } from "../lib/format";
import { trialWords } from "../lib/states";
import { bestBeforeOf, sentenceOf } from "../lib/verdict";
import { Classify } from "./Classify";
import { Panel } from "./Panel";
import { StateBadge } from "./StateBadge";
import { Time } from "./Time";
import classes from "./Verdict.module.css";

interface Props {
  trial: Trial;
  trials: readonly Trial[];
  isBest: boolean;
  /** On the flight's own page there is no link to that page. */
  own?: boolean;
}

/** `error` against `other`; two that print alike are the same. */
function Change({ error, other }: { error: number | null; other: number | null | undefined }) {
  const percent = percentChange(error, other);
  if (percent === null) return null;
  if (withUnit(error, "m") === withUnit(other, "m")) return <small>the same</small>;
  const size = Math.abs(percent).toFixed(0);
  const lower = percent < 0;
  return (
    <small data-better={lower || undefined}>
      {size} % {lower ? "lower" : "higher"}
    </small>
  );
}

/** What happened in a flight: against the best before it, against its prediction, and what it counts for. */
export function VerdictPanel({ trial, trials, isBest, own = false }: Props) {
  const bestBefore = bestBeforeOf(trial, trials);
  return (
    <Panel
      title={`Flight ${trial.number}${isBest && trial.state === "valid" ? " · best so far" : ""}`}
      tools={
        <span className={classes["when"]}>
          <Time at={trial.flown_at} />
          <StateBadge words={trialWords(trial.state)} />
        </span>
      }
    >
      <p className={classes["sentence"]}>{sentenceOf(trial)}</p>
      {trial.verdict && trial.reason && !trial.verdict.includes(trial.reason) && (
        <p className={classes["reason"]}>{trial.reason}</p>
      )}
      <dl className={`${classes["figures"]} numbers`}>
        <div>
          <dt>Error</dt>
          <dd>{withUnit(trial.error, "m")}</dd>
        </div>
        <div>
          <dt>Predicted</dt>
          <dd>
            {withUnit(trial.predicted_error, "m")} <Change error={trial.error} other={trial.predicted_error} />
          </dd>
        </div>
        <div>
          <dt>{bestBefore ? `Best before, flight ${bestBefore.number}` : "Best before"}</dt>
          <dd>
            {withUnit(bestBefore?.error, "m")} <Change error={trial.error} other={bestBefore?.error} />
          </dd>
        </div>
        <div>
          <dt>Overshoot</dt>
          <dd>{withUnit(trial.overshoot_m, "m", 2)}</dd>
        </div>
        <div className={classes["wide"]}>
          <dt>Gains</dt>
          <dd className={classes["gains"]}>
            {Object.entries(trial.gains)
              .map(([name, value]) => `${name} ${gainText(value)}`)
              .join(" · ")}
          </dd>
        </div>
      </dl>
      <div className={classes["acts"]}>
        <Classify key={`${trial.id} ${trial.state}`} trial={trial} />
        {trial.record !== null && (
          <Button
            component="a"
            href={recordCsv(trial.id)}
            download
            variant="default"
            leftSection={<IconDownload size={18} aria-hidden />}
          >
            Record as CSV
          </Button>
        )}
        {!own && (
          <Anchor
            component={Link}
            to={`/campaigns/${trial.campaign_id}/flights/${trial.id}`}
            className={classes["link"]}
          >
            Open the flight
          </Anchor>
        )}
      </div>
    </Panel>
  );
}
