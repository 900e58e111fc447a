import { Button, Chip, TextInput } from "@mantine/core";
import { useState } from "react";
import { useClassify } from "../api/mutations";
import type { Trial } from "../api/types";
import { problemOf, reasonsByField } from "../lib/problems";
import { INVALID_REASONS, otherClasses } from "../lib/verdict";
import { Trouble } from "./Trouble";
import classes from "./Verdict.module.css";

const WORDS = { valid: "Count it as valid", aborted: "Class as aborted", invalid: "Mark invalid" } as const;

/** Say what a flight is worth: one tap to undo, a reason to throw out. */
export function Classify({ trial }: { trial: Trial }) {
  const [asking, setAsking] = useState(false);
  const [reason, setReason] = useState(trial.state === "lost" ? trial.reason : "");
  const classify = useClassify();
  const others = otherClasses(trial);
  if (others.length === 0) return null;
  if (asking) {
    const refused = reasonsByField(problemOf(classify.error), ["reason"])["reason"];
    return (
      <form
        className={classes["classify"]}
        onSubmit={(event) => {
          event.preventDefault();
          classify.mutate({ trial, outcome: "invalid", reason });
        }}
      >
        <p>An invalid flight keeps its record, but nothing is computed from it. Why is it invalid?</p>
        <Chip.Group value={reason} onChange={(value) => setReason(value)}>
          <div className={classes["chips"]}>
            {INVALID_REASONS.map((one) => (
              <Chip key={one} value={one} size="lg" variant="outline">
                {one}
              </Chip>
            ))}
          </div>
        </Chip.Group>
        <TextInput
          label="Reason"
          value={reason}
          maxLength={500}
          error={refused}
          onChange={(event) => setReason(event.currentTarget.value)}
        />
        <div className={classes["acts"]}>
          <Button type="submit" color="red" disabled={reason.trim() === ""} loading={classify.isPending}>
            Mark invalid
          </Button>
          <Button variant="default" onClick={() => setAsking(false)}>
            Keep it
          </Button>
        </div>
        <Trouble error={classify.error} shown={["reason"]} />
      </form>
    );
  }
  return (
    <>
      {others.map((outcome) => (
        <Button
          key={outcome}
          variant={outcome === "invalid" || trial.state === "invalid" ? "default" : "filled"}
          loading={classify.isPending}
          onClick={() =>
            outcome === "invalid"
              ? setAsking(true)
              : classify.mutate({
                  trial,
                  outcome,
                  reason: trial.state === "invalid" ? "counted again by the operator" : "judged by the operator",
                })
          }
        >
          {trial.state === "invalid" ? `Undo: ${WORDS[outcome].toLowerCase()}` : WORDS[outcome]}
        </Button>
      ))}
      <Trouble error={classify.error} />
    </>
  );
}
