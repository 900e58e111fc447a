import { Button } from "@mantine/core";
import { IconRepeat } from "@tabler/icons-react";
import { useCreateTrial } from "../../api/mutations";
import type { Campaign, Trial } from "../../api/types";
import { ErrorNotice } from "../../ui/ErrorNotice";
import { speedOf } from "./nextStep";
import { useSpeed } from "./SpeedSwitch";

/** Retry of the gains of an aborted or invalid flight: flown at once on a simulation, otherwise staged. */
export function RetryGains({ campaign, trial }: { campaign: Campaign; trial: Trial }) {
  const create = useCreateTrial(campaign);
  const [speed] = useSpeed();
  const { can_fly, needs_staging } = campaign.vehicle;
  if (!campaign.actions.includes("plan") || !can_fly || !["aborted", "invalid"].includes(trial.state)) return null;
  const order = needs_staging ? {} : { fly: { speed: speedOf(speed) } };
  return (
    <>
      <Button
        variant="default"
        leftSection={<IconRepeat size={18} aria-hidden />}
        loading={create.isPending}
        onClick={() => create.mutate({ gains: trial.gains, ...order })}
      >
        Retry these gains
      </Button>
      <ErrorNotice error={create.error} />
    </>
  );
}
