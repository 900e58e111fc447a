import { Button, Stack } from "@mantine/core";
import { IconArchive } from "@tabler/icons-react";
import { useArchive } from "../../api/mutations";
import type { Campaign, Trial } from "../../api/types";
import { Aside } from "../../ui/Aside";
import { against, percentChange, withUnit } from "../../ui/format";
import { GainList } from "../../ui/gains";
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

interface Props {
  campaign: Campaign;
  trials: readonly Trial[];
  onChoose: (trialNumber: number) => void;
}

/** The campaign's result, and its next actions. */
export function FinishedCard({ campaign, trials, onChoose }: Props) {
  const archive = useArchive(campaign.id);
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
          </Aside>
        )}
        {best !== null && (
          <Button variant="default" onClick={() => onChoose(best.number)}>
            Show flight {best.number}
          </Button>
        )}
        <PromoteGains campaign={campaign} />
        <Note fz="body">
          This campaign has no more flights. To continue, clone it. With “Start from flight” on, the clone starts from
          the best gains found here.
        </Note>
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
