import { Button, Group, Stack } from "@mantine/core";
import { useState } from "react";
import { Note } from "./Note";
import { ErrorNotice } from "./Notices";

interface Props {
  /** What is done, on both buttons. */
  act: string;
  question: string;
  otherwise: string;
  /** Does it, and how far that has come. */
  mutation: { error: unknown; isPending: boolean; mutate: () => void };
}

/** A button that asks before it acts. */
export function Question({ act, question, otherwise, mutation }: Props) {
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
