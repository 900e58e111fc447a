import { Anchor, Button } from "@mantine/core";
import { Link } from "react-router";
import { useTrials } from "../../api/queries";
import type { Campaign, Trial } from "../../api/types";
import { trialWords } from "../../lib/states";
import { sentenceOf } from "../../lib/verdict";
import { AbortCause } from "../AbortCause";
import { Classify } from "../Classify";
import { FlightNotes } from "../FlightNotes";
import { Kept, Marks } from "../Marks";
import { StateBadge } from "../StateBadge";
import classes from "./Fly.module.css";

interface Props {
  campaign: Campaign;
  trial: Trial;
}

/** What the flight was worth: a suggestion, one tap, and on to the next. */
export function Judge({ campaign, trial }: Props) {
  const trials = useTrials(campaign.id).data ?? [];
  const page = `/campaigns/${campaign.id}`;
  return (
    <div className={classes["stack"]}>
      <p className={classes["marks"]}>
        <StateBadge words={trialWords(trial.state)} />
        <Kept trial={trial} />
        <Marks trial={trial} />
      </p>
      {trial.state !== "captured" && <p className={classes["say"]}>{sentenceOf(trial)}</p>}
      <AbortCause trial={trial} />
      <div className={classes["classes"]}>
        <Classify key={`${trial.id} ${trial.state}`} trial={trial} trials={trials} />
      </div>
      <FlightNotes trial={trial} />
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
