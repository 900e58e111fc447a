/** Acts that end a campaign, each after a question. */

import { Button, Group, Stack } from "@mantine/core";
import { useState } from "react";
import { useNavigate } from "react-router";
import { useArchive, useDeleteCampaign, useFinish } from "../../api/mutations";
import type { Campaign } from "../../api/types";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";

interface QuestionProps {
  /** What is done, on both buttons. */
  act: string;
  question: string;
  otherwise: string;
  error: unknown;
  isPending: boolean;
  onYes: () => void;
}

function Question({ act, question, otherwise, error, isPending, onYes }: QuestionProps) {
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
        <Button color="red" loading={isPending} onClick={onYes}>
          {act}
        </Button>
      </Group>
      <ErrorNotice error={error} />
    </Stack>
  );
}

/** Ends the campaign between flights; planned trials are cancelled. */
export function StopCampaign({ campaignId }: { campaignId: number }) {
  const { error, isPending, mutate } = useFinish(campaignId);
  return (
    <Question
      act="Stop campaign"
      question="Stop this campaign? Its flights are kept, and it can be reopened."
      otherwise="Continue campaign"
      error={error}
      isPending={isPending}
      onYes={() => mutate()}
    />
  );
}

/** Moves a finished campaign to the archive. */
export function ArchiveCampaign({ campaignId }: { campaignId: number }) {
  const { error, isPending, mutate } = useArchive(campaignId);
  return (
    <Question
      act="Archive"
      question="Archive this campaign? It stays readable and can be cloned, but not reopened or reviewed any more."
      otherwise="Cancel"
      error={error}
      isPending={isPending}
      onYes={() => mutate()}
    />
  );
}

/** Deletes a campaign that has not flown. */
export function DeleteCampaign({ campaign }: { campaign: Campaign }) {
  const navigate = useNavigate();
  const { error, isPending, mutate } = useDeleteCampaign(campaign, () => void navigate("/"));
  return (
    <Question
      act="Delete campaign"
      question="Delete this campaign? It has not flown, and nothing of it is kept."
      otherwise="Cancel"
      error={error}
      isPending={isPending}
      onYes={() => mutate()}
    />
  );
}
