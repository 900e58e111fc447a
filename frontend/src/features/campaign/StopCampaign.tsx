import { Button, Stack } from "@mantine/core";
import { useState } from "react";
import { useFinish } from "../../api/mutations";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import classes from "./NextFlight.module.css";

/** Ends the campaign between flights, after a confirmation because planned trials are cancelled. */
export function StopCampaign({ campaignId }: { campaignId: number }) {
  const [asking, setAsking] = useState(false);
  const finish = useFinish(campaignId);
  if (!asking) {
    return (
      <Button variant="subtle" color="gray" c="var(--dim)" onClick={() => setAsking(true)}>
        Stop campaign
      </Button>
    );
  }
  return (
    <Stack gap={14}>
      <Note fz="body">Stop this campaign? Its flights are kept, and it can be reopened.</Note>
      <div className={classes["row"]}>
        <Button variant="default" onClick={() => setAsking(false)}>
          Continue campaign
        </Button>
        <Button color="red" loading={finish.isPending} onClick={() => finish.mutate()}>
          Stop campaign
        </Button>
      </div>
      <ErrorNotice error={finish.error} />
    </Stack>
  );
}
