import { Button, Stack, Text } from "@mantine/core";
import { IconRepeat } from "@tabler/icons-react";
import { useGateRefusal } from "../../../api/evaluation";
import { useReopen } from "../../../api/mutations";
import { useStatistics } from "../../../api/queries";
import type { Campaign, CampaignStatistics, RepeatGroup } from "../../../api/types";
import { Aside } from "../../../ui/Aside";
import { against, count, flightsText, percentChange } from "../../../ui/format";
import { GainList } from "../../../ui/gains";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { campaignStateLabel } from "../../../ui/states";
import { confidenceText, plusMinus } from "../../../ui/uncertainty";
import { useUnits } from "../../../ui/units";
import { CloneForm } from "../../new-campaign/CloneForm";
import { ArchiveCampaign } from "../EndCampaign";
import { PromoteGains } from "../verdict/PromoteGains";
import { confirmationOf, confirmationText, endingOf } from "./finishedCampaign";
import { LoadGains } from "./LoadGains";

const FURTHER_FLIGHTS = 3;

const STANDINGS: Record<NonNullable<Campaign["standing"]>, [word: string, meaning: string]> = {
  candidate: ["Candidate", "not yet confirmed by repeat flights."],
  confirmed: ["Confirmed", "better than the first gains in repeat flights."],
  "not confirmed": ["Not confirmed", "no improvement over the first gains in repeat flights."],
};

interface Props {
  campaign: Campaign;
  onChoose: (trialNumber: number) => void;
  /** Whether another card has the next action. */
  isSecondary: boolean;
}

/** The campaign's result, and its next actions. */
export function FinishedCard({ campaign, onChoose, isSecondary }: Props) {
  const reopen = useReopen(campaign.id);
  const { data: statistics, isPending } = useStatistics(campaign.id);
  const { groups, comparison, drift } = statistics ?? { groups: [], comparison: null, drift: null };
  const winner = groups.find(({ is_best }) => is_best);
  const first = groups.find(({ is_baseline }) => is_baseline);
  const missing = campaign.standing === "candidate" ? confirmationOf(winner, first) : [];
  const wanted = missing.flatMap((kind) => (kind === "repeat" ? winner : first) ?? []).map(({ gains }) => gains);
  const refusal = useGateRefusal(campaign.id, wanted);
  const isCandidate = missing.length > 0 && refusal === "";
  const bestFlight = winner === undefined ? null : bestFlightOf(winner);
  const title = campaignStateLabel({ ...campaign, state: "finished", rehearsal: "not needed" }).word;
  const reason = endingOf(campaign, comparison);
  return (
    <Panel title={title}>
      <Stack gap={14}>
        {reason.toLowerCase() !== title.toLowerCase() && <Note fz="body">{reason}</Note>}
        {winner !== undefined && first !== undefined && (
          <Result campaign={campaign} winner={winner} first={first} comparison={comparison} />
        )}
        {drift?.resolved && (
          <Aside tone="warn" fz="small">
            {drift.sentence}
          </Aside>
        )}
        {isCandidate && <Note fz="body">{confirmationText(missing)}</Note>}
        {refusal !== "" && !reason.includes(refusal) && (
          <Note fz="body">
            The best gains cannot be confirmed: the gate refuses another flight that it needs. {refusal}
          </Note>
        )}
        {campaign.actions.includes("reopen") && !isPending && (
          <Button
            variant={isCandidate && !isSecondary ? "filled" : "default"}
            leftSection={<IconRepeat size={20} aria-hidden />}
            loading={reopen.isPending}
            onClick={() => reopen.mutate({ flights: isCandidate ? missing.length : FURTHER_FLIGHTS, plan: missing })}
          >
            {isCandidate
              ? `Confirm with ${count(missing.length, "flight")}`
              : `Reopen for ${FURTHER_FLIGHTS} more flights`}
          </Button>
        )}
        <ErrorNotice error={reopen.error} />
        {bestFlight !== null && (
          <Button variant="default" onClick={() => onChoose(bestFlight)}>
            Show flight {bestFlight}
          </Button>
        )}
        {campaign.parameter_file !== null && winner !== undefined && first !== undefined && (
          <LoadGains campaign={campaign} best={winner.gains} first={first.gains} />
        )}
        <PromoteGains campaign={campaign} />
        <Note fz="body">A clone is a new campaign with the same settings.</Note>
        <CloneForm {...campaign} experiment={campaign.definition.experiment} bestFlight={bestFlight} />
        {campaign.actions.includes("archive") && <ArchiveCampaign campaignId={campaign.id} />}
      </Stack>
    </Panel>
  );
}

/** Number of the flight with the lowest error, the earliest of equals. */
function bestFlightOf({ trial_numbers, errors }: RepeatGroup): number | null {
  return trial_numbers[errors.indexOf(Math.min(...errors))] ?? null;
}

interface ResultProps {
  campaign: Campaign;
  winner: RepeatGroup;
  first: RepeatGroup;
  comparison: CampaignStatistics["comparison"];
}

/** The best gains beside the first, each with the mean of all its flights. */
function Result({ campaign, winner, first, comparison }: ResultProps) {
  const experiment = campaign.definition.experiment;
  const unit = useUnits(experiment).error;
  const change = percentChange(winner.mean, first.mean);
  const standing = campaign.standing && STANDINGS[campaign.standing];
  return (
    <Aside tone="good">
      <p>Best gains ({flightsText(winner.trial_numbers)})</p>
      <Text fz="var(--text-figure)" fw={650} my={4} lh="inherit">
        {plusMinus(winner.mean, winner.standard_error, unit)}
      </Text>
      {winner.standard_error !== null && <p>{winner.errors.length > 1 ? "mean " : ""}± standard error</p>}
      <GainList gains={winner.gains} experiment={experiment} />
      {change !== null && comparison !== null && (
        <>
          <p>
            First gains ({flightsText(first.trial_numbers)}):{" "}
            <span className="quantity">{plusMinus(first.mean, first.standard_error, unit)}</span>
          </p>
          <p>
            {against(change, "the first gains")} ·{" "}
            <strong>
              {comparison.verdict}
              {comparison.confidence !== null && ` with ${confidenceText(comparison.confidence)} confidence`}
            </strong>
          </p>
        </>
      )}
      {standing && (
        <p>
          <strong>{standing[0]}</strong>: {standing[1]}
        </p>
      )}
    </Aside>
  );
}
