import { Button } from "@mantine/core";
import { useState } from "react";
import { useFinish } from "../../api/mutations";
import { ErrorNotice } from "../../ui/ErrorNotice";
import classes from "./NextFlight.module.css";

/** Ends the campaign between flights; a finished campaign cannot be taken up again, so it asks once. */
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
    <div className={classes["stack"]}>
      <p className={classes["quiet"]}>No more flights in this campaign? It keeps its flights and can be cloned.</p>
      <div className={classes["row"]}>
        <Button variant="default" onClick={() => setAsking(false)}>
          Keep going
        </Button>
        <Button color="red" loading={finish.isPending} onClick={() => finish.mutate()}>
          Stop it
        </Button>
      </div>
      <ErrorNotice error={finish.error} />
    </div>
  );
}
