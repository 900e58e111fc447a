import { Button, Stack, TextInput } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import { useState } from "react";
import { Note } from "../../../ui/Note";
import classes from "../next-flight/NextFlight.module.css";

/** Simulations only: fly gains that the gate refuses, with a reason that is stored with the flight. */
export function OverruleGate({ pending, onFly }: { pending: boolean; onFly: (reason: string) => void }) {
  const [reason, setReason] = useState("");
  return (
    <details className={classes["more"]}>
      <summary>Overrule the gate</summary>
      <Stack gap={14}>
        <Note fz="body">
          Refused gains can be flown on a simulated vehicle only. The reason is saved and shown with the flight.
        </Note>
        <TextInput
          label="Reason"
          placeholder="For example: the paper flew these gains"
          value={reason}
          maxLength={500}
          onChange={(event) => setReason(event.currentTarget.value)}
        />
        <Button
          color="red"
          variant="outline"
          leftSection={<IconAlertTriangle size={20} aria-hidden />}
          disabled={reason.trim() === ""}
          loading={pending}
          onClick={() => onFly(reason.trim())}
        >
          Fly refused gains
        </Button>
      </Stack>
    </details>
  );
}
