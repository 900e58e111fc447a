import { Button, Stack } from "@mantine/core";
import { IconArchive, IconRepeat } from "@tabler/icons-react";
import { useArchive, useReopen } from "../../api/mutations";
import type { Campaign, Trial } from "../../api/types";
import { Aside } from "../../ui/Aside";
import { against, flightsText, percentChange, withUnit } from "../../ui/format";
import { GainList, gainsInBrackets, sameHeld } from "../../ui/gains";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import { campaignStateLabel } from "../../ui/states";
import { plusMinus } from "../../ui/uncertainty";
import { useUnits } from "../../ui/units";
import { CloneForm } from "../campaigns/CloneForm";
import classes from "./NextFlight.module.css";
import { bestOf } from "./nextStep";
import { PromoteGains } from "./PromoteGains";
import { VERDICTS } from "./verdict";

const FURTHER_FLIGHTS = 3;
const CONFIRMATION = ["repeat", "baseline", "repeat"] as const;

const STANDINGS: Record<NonNullable<Campaign["standing"]>, { word: string; meaning: string }> = {
  candidate: { word: "Candidate", meaning: "not yet confirmed by repeat flights." },
  confirmed: { word: "Confirmed", meaning: "better than the first gains in repeat flights." },
  "not confirmed": { word: "Not confirmed", meaning: "no improvement over the first gains in repeat flights." },
};

/** The gains that were repeated, if they are others than those of the best flight. */
function otherWinner({ winner }: Campaign, best: Trial): string {
  if (winner === null || sameHeld(winner.gains, best.gains)) return "";
  return `${gainsInBrackets(winner.gains)} of ${flightsText(winner.trial_numbers)}, `;
}

interface Props {
  campaign: Campaign;
  trials: readonly Trial[];
  onChoose: (trialNumber: number) => void;
  /** Whether another card has the next action. */
  isSecondary: boolean;
}

/** The campaign's result, and its next actions. */
export function FinishedCard({ campaign, trials, onChoose, isSecondary }: Props) {
  const archive = useArchive(campaign.id);
  const reopen = useReopen(campaign.id);
  const isCandidate = campaign.standing === "candidate";
  const experiment = campaign.definition.experiment ?? "";
  const unit = useUnits(experiment).error;
  const best = bestOf(campaign, trials);
  const first = trials.find((trial) => trial.state === "valid");
  const title = campaignStateLabel("finished", campaign.outcome).word;
  const change = percentChange(campaign.best?.mean, first?.error);
  return (
    <Panel title={title}>
      <Stack gap={14}>
        {campaign.stop_reason?.toLowerCase() !== title.toLowerCase() && <Note fz="body">{campaign.stop_reason}</Note>}
        {best !== null && campaign.best !== null && (
          <Aside tone="good" className={`${classes["best"]} numbers`}>
            <p>Best: flight {best.number}</p>
            <p className={classes["figure"]}>{plusMinus(campaign.best.mean, campaign.best.standard_error, unit)}</p>
            {campaign.best.standard_error !== null && <p>± standard error</p>}
            {campaign.best.flights > 1 && <p>mean of {campaign.best.flights} flights</p>}
            <p>
              <GainList gains={best.gains} experiment={experiment} />
            </p>
            {first && change !== null && best.id !== first.id && (
              <p>
                {against(change, `flight ${first.number}`)} ({withUnit(first.error, unit)})
                {campaign.verdict && <strong> · {VERDICTS[campaign.verdict].toLowerCase()}</strong>}
              </p>
            )}
            {campaign.standing !== null && (
              <p>
                <strong>{STANDINGS[campaign.standing].word}</strong>: {otherWinner(campaign, best)}
                {STANDINGS[campaign.standing].meaning}
              </p>
            )}
          </Aside>
        )}
        {isCandidate && (
          <Note fz="body">
            Two more flights with the best gains and one with the first gains will show whether the best gains are
            better.
          </Note>
        )}
        {campaign.actions.includes("reopen") && (
          <Button
            variant={isCandidate && !isSecondary ? "filled" : "default"}
            leftSection={<IconRepeat size={20} aria-hidden />}
            loading={reopen.isPending}
            onClick={() => reopen.mutate({ flights: FURTHER_FLIGHTS, plan: isCandidate ? [...CONFIRMATION] : [] })}
          >
            {isCandidate ? `Confirm with ${FURTHER_FLIGHTS} flights` : `Reopen for ${FURTHER_FLIGHTS} more flights`}
          </Button>
        )}
        <ErrorNotice error={reopen.error} />
        {best !== null && (
          <Button variant="default" onClick={() => onChoose(best.number)}>
            Show flight {best.number}
          </Button>
        )}
        <PromoteGains campaign={campaign} />
        <Note fz="body">A clone is a new campaign with the same settings.</Note>
        <CloneForm {...campaign} experiment={experiment} />
        {campaign.actions.includes("archive") && (
          <Button
            variant="subtle"
            color="gray"
            c="var(--dim)"
            leftSection={<IconArchive size={18} aria-hidden />}
            loading={archive.isPending}
            onClick={() => archive.mutate()}
          >
            Archive
          </Button>
        )}
        <ErrorNotice error={archive.error} />
      </Stack>
    </Panel>
  );
}
