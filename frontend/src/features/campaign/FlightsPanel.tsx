import { Anchor, Skeleton } from "@mantine/core";
import { memo } from "react";
import { Link } from "react-router";
import type { Campaign, Trial } from "../../api/types";
import { Note } from "../../ui/Note";
import { Panel } from "../../ui/Panel";
import classes from "./FlightsPanel.module.css";
import { TrialsTable } from "./TrialsTable";

interface Props {
  campaign: Campaign;
  /** Null while loading. */
  trials: readonly Trial[] | null;
  shown: number | null;
  unit: string;
  onChoose: (trialNumber: number) => void;
}

/** The table of all flights, with a link to compare them. */
export const FlightsPanel = memo(function FlightsPanel({ campaign, trials, shown, unit, onChoose }: Props) {
  const compare = (
    <Anchor component={Link} to={`/compare?campaign=${campaign.id}`} py={12}>
      Compare flights
    </Anchor>
  );
  return (
    <Panel title="All flights" className={classes["panel"]} tools={trials?.length ? compare : null}>
      {trials === null && <Skeleton height={320} radius="md" />}
      {trials?.length === 0 && <Note>No flights yet. Flights appear here with their gains and errors.</Note>}
      {trials !== null && trials.length > 0 && (
        <TrialsTable campaign={campaign} trials={trials} shown={shown} unit={unit} onChoose={onChoose} />
      )}
    </Panel>
  );
});
