import { Anchor, Button, Stack } from "@mantine/core";
import { Link } from "react-router";
import { useTrials } from "../../api/queries";
import type { Campaign, Trial } from "../../api/types";
import { StateBadge } from "../../ui/StateBadge";
import { trialStateLabel } from "../../ui/states";
import { AbortCause } from "../campaign/AbortCause";
import { FlightMarkers, PredictionResult } from "../campaign/FlightMarkers";
import { FlightNotes } from "../campaign/FlightNotes";
import { FlightReview } from "../campaign/FlightReview";
import { sentenceOf } from "../campaign/verdict";
import classes from "./Fly.module.css";

interface Props {
  campaign: Campaign;
  trial: Trial;
}

/** Result of the flight, its review, and the link to the next flight. */
export function FlightReviewCard({ campaign, trial }: Props) {
  const trials = useTrials(campaign.id).data ?? [];
  const page = `/campaigns/${campaign.id}`;
  return (
    <Stack gap={12}>
      <p className={classes["marks"]}>
        <StateBadge words={trialStateLabel(trial.state)} />
        <PredictionResult trial={trial} />
        <FlightMarkers trial={trial} />
      </p>
      {trial.state !== "captured" && <p className={classes["say"]}>{sentenceOf(trial)}</p>}
      <AbortCause trial={trial} />
      <Stack gap={8}>
        <FlightReview key={`${trial.id} ${trial.state}`} trial={trial} trials={trials} />
      </Stack>
      <FlightNotes trial={trial} />
      <div className={classes["onward"]}>
        {trial.state !== "captured" && trial.state !== "lost" && (
          <Button component={Link} to={page} size="lg" fullWidth>
            Next flight
          </Button>
        )}
        <Anchor component={Link} to={`${page}/flights/${trial.id}`} display="inline-block" py={12}>
          Open flight
        </Anchor>
      </div>
    </Stack>
  );
}
