import { Anchor, Button } from "@mantine/core";
import { Link } from "react-router";
import type { Campaign, Trial } from "../../api/types";
import { suggestedClass } from "../../lib/flyScreen";
import { trialWords } from "../../lib/states";
import { sentenceOf } from "../../lib/verdict";
import { Classify } from "../Classify";
import { Kept, Marks } from "../Marks";
import { StateBadge } from "../StateBadge";
import classes from "./Fly.module.css";

interface Props {
  campaign: Campaign;
  trial: Trial;
}

/** What the flight was worth: a suggestion, one tap, and on to the next. */
export function Judge({ campaign, trial }: Props) {
  const suggestion = suggestedClass(trial);
  const page = `/campaigns/${campaign.id}`;
  return (
    <div className={classes["stack"]}>
      <p className={classes["marks"]}>
        <StateBadge words={trialWords(trial.state)} />
        <Kept trial={trial} />
        <Marks trial={trial} />
      </p>
      {trial.state !== "captured" && <p className={classes["say"]}>{sentenceOf(trial)}</p>}
      {suggestion !== null && (
        <p className={classes["say"]}>
          Suggested: <strong>{suggestion.outcome}</strong>, {suggestion.why}.
        </p>
      )}
      <div className={classes["classes"]}>
        <Classify key={`${trial.id} ${trial.state}`} trial={trial} suggestion={suggestion} />
      </div>
      <div className={classes["onward"]}>
        {trial.state !== "captured" && trial.state !== "lost" && (
          <Button component={Link} to={page} size="lg" fullWidth>
            Next flight
          </Button>
        )}
        <Anchor component={Link} to={`${page}/flights/${trial.id}`} className={classes["link"]}>
          Open the flight
        </Anchor>
      </div>
    </div>
  );
}
