import { Button, Stack, TextInput } from "@mantine/core";
import { IconShieldCheck } from "@tabler/icons-react";
import { useState } from "react";
import { usePromote } from "../../../api/mutations";
import { problemOf, reasonsByField } from "../../../api/problems";
import type { Campaign } from "../../../api/types";
import { useVehicle } from "../../../api/vehicles";
import { gainsInBrackets, sameHeld } from "../../../ui/gains";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import page from "../CampaignPage.module.css";
import { heldGainsNotice, promotionRefusal } from "./promotion";

/** Set the best gains as the vehicle's safe gains, once flights have shown that they are better. */
export function PromoteGains({ campaign }: { campaign: Campaign }) {
  const [asking, setAsking] = useState(false);
  const [statement, setStatement] = useState("");
  const promote = usePromote(campaign);
  const vehicle = useVehicle(campaign.vehicle.registered ? campaign.vehicle.id : null);
  if (vehicle === null || campaign.winner === null) return null;
  const why = promotionRefusal(campaign.winner, vehicle);
  if (why !== "") {
    const isDone = sameHeld(vehicle.safe_gains, campaign.winner.gains);
    return (
      <Note fz="body">
        {why} {isDone && campaign.flying === null && heldGainsNotice(vehicle)}
      </Note>
    );
  }
  if (!asking) {
    return (
      <Button
        variant="default"
        className={page["wrapping"]}
        leftSection={<IconShieldCheck size={20} aria-hidden />}
        onClick={() => setAsking(true)}
      >
        Set best gains as safe gains
      </Button>
    );
  }
  return (
    <Stack
      component="form"
      gap={14}
      onSubmit={(event) => {
        event.preventDefault();
        promote.mutate({ version: vehicle.version, statement }, { onSuccess: () => setAsking(false) });
      }}
    >
      <Note fz="body">
        After every flight and abort, {vehicle.name} will be set to {gainsInBrackets(campaign.winner.gains)} instead of{" "}
        {gainsInBrackets(vehicle.safe_gains)}.
      </Note>
      <TextInput
        label="Decided by, and based on which flights"
        value={statement}
        maxLength={500}
        error={reasonsByField(problemOf(promote.error), ["statement"])["statement"]}
        onChange={(event) => setStatement(event.currentTarget.value)}
      />
      <Button type="submit" disabled={statement.trim() === ""} loading={promote.isPending}>
        Save safe gains
      </Button>
      <Button variant="default" onClick={() => setAsking(false)}>
        Cancel
      </Button>
      <ErrorNotice error={promote.error} shown={["statement"]} />
    </Stack>
  );
}
