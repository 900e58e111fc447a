/** Acts that end a campaign, each after a question. */

import { Button, Group, Stack } from "@mantine/core";
import { useState } from "react";
import { navigate } from "wouter/use-browser-location";
import { useArchive, useDeleteCampaign, useFinish } from "../../api/mutations";
import type { Campaign } from "../../api/types";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";

interface QuestionProps {
  /** What is done, on both buttons. */
  act: string;
  question: string;
  otherwise: string;
  /** Does it, and how far that has come. */
  mutation: { error: unknown; isPending: boolean; mutate: () => void };
}

function Question({ act, question, otherwise, mutation }: QuestionProps) {
  const [asking, setAsking] = useState(false);
  if (!asking) {
    return (
      <Button variant="subtle" color="gray" c="var(--dim)" onClick={() => setAsking(true)}>
        {act}
      </Button>
    );
  }
  return (
    <Stack gap={14}>
      <Note fz="body">{question}</Note>
      <Group grow gap={8}>
        <Button variant="default" onClick={() => setAsking(false)}>
          {otherwise}
        </Button>
        <Button color="red" loading={mutation.isPending} onClick={() => mutation.mutate()}>
          {act}
        </Button>
      </Group>
      <ErrorNotice error={mutation.error} />
    </Stack>
  );
}

/** Ends the campaign between flights; planned trials are cancelled. */
export function StopCampaign({ campaignId }: { campaignId: number }) {
  return (
    <Question
      act="Stop campaign"
      question="Stop this campaign? Its flights are kept, and it can be reopened."
      otherwise="Continue campaign"
      mutation={useFinish(campaignId)}
    />
  );
}

/** Moves a finished campaign to the archive. */
export function ArchiveCampaign({ campaignId }: { campaignId: number }) {
  return (
    <Question
      act="Archive"
      question="Archive this campaign? It stays readable and can be cloned, but not reopened or reviewed any more."
      otherwise="Cancel"
      mutation={useArchive(campaignId)}
    />
  );
}

/** Deletes a campaign that has not flown. */
export function DeleteCampaign({ campaign }: { campaign: Campaign }) {
  return (
    <Question
      act="Delete campaign"
      question="Delete this campaign? It has not flown, and nothing of it is kept."
      otherwise="Cancel"
      mutation={useDeleteCampaign(campaign, () => navigate("/"))}
    />
  );
}
