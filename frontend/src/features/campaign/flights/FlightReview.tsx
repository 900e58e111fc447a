import { Button, Chip, Stack, Text, TextInput } from "@mantine/core";
import { useState } from "react";
import { useClassify, useJudgeAbort } from "../../../api/mutations";
import { problemOf, reasonsByField } from "../../../api/problems";
import type { Campaign, Trial } from "../../../api/types";
import { ErrorNotice } from "../../../ui/Notices";
import classes from "./FlightReview.module.css";
import {
  abortSentence,
  abortWords,
  consequenceOf,
  INVALID_REASONS,
  otherClasses,
  type Suggestion,
  suggestedClass,
} from "./review";

const WORDS = { valid: "Mark valid", aborted: "Mark aborted", invalid: "Mark invalid" } as const;

const showWhole = (form: HTMLFormElement | null) => form?.scrollIntoView({ block: "nearest" });

interface Props {
  trial: Trial;
  /** All trials of the campaign, for the consequences of a review. */
  trials: readonly Trial[];
  campaign: Pick<Campaign, "state" | "outcome"> | undefined;
}

/** Review of a flight: the suggested class first, undo in one tap, and a reason to mark it invalid. */
export function FlightReview({ trial, trials, campaign }: Props) {
  const [asking, setAsking] = useState(false);
  const [reason, setReason] = useState(trial.state === "lost" ? trial.reason : "");
  const classify = useClassify();
  const isEndedByRule = campaign?.state === "finished" && campaign.outcome !== "stopped";
  const suggestion = suggestedClass(trial);
  const others = otherClasses(trial).sort((one, other) => rank(one, suggestion) - rank(other, suggestion));
  if (others.length === 0) return null;

  function choose(outcome: Suggestion["outcome"]): void {
    const suggested = suggestion?.outcome === outcome ? suggestion.why : "";
    if (outcome === "invalid" && suggested === "") {
      setAsking(true);
      return;
    }
    const word = trial.state === "invalid" ? "restored by the operator" : "reviewed by the operator";
    classify.mutate({ trial, outcome, reason: outcome === "invalid" ? suggested : word });
  }

  if (asking) {
    const refused = reasonsByField(problemOf(classify.error), ["reason"])["reason"];
    return (
      <form
        ref={showWhole}
        className={classes["classify"]}
        onSubmit={(event) => {
          event.preventDefault();
          classify.mutate({ trial, outcome: "invalid", reason });
        }}
      >
        <p>
          The record of an invalid flight is kept, but not used for any computation.{" "}
          <strong>{consequenceOf(trial, trials, "invalid")}</strong>
          {isEndedByRule && " The campaign reopens if its stop rule is no longer met."} Why is it invalid?
        </p>
        <Chip.Group value={reason} onChange={(value) => setReason(value)}>
          <div className={classes["chips"]}>
            {INVALID_REASONS.map((one) => (
              <Chip key={one} value={one} size="sm" variant="outline">
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
        <div className={classes["answers"]}>
          <Button type="submit" color="red" disabled={reason.trim() === ""} loading={classify.isPending}>
            Mark invalid
          </Button>
          <Button variant="default" onClick={() => setAsking(false)}>
            Cancel
          </Button>
        </div>
        <ErrorNotice error={classify.error} shown={["reason"]} />
      </form>
    );
  }
  return (
    <>
      {suggestion !== null && (
        <Text w="100%" fz="body" lh={1.4}>
          Suggested: <strong>{suggestion.outcome}</strong> ({suggestion.why.replace(/\.$/, "")}).
          {suggestion.outcome === "invalid" && ` ${consequenceOf(trial, trials, "invalid")}`}
        </Text>
      )}
      {others.map((outcome) => (
        <Button
          key={outcome}
          variant={standsOut(outcome, trial, suggestion) ? "filled" : "default"}
          loading={classify.isPending}
          title={consequenceOf(trial, trials, outcome)}
          onClick={() => choose(outcome)}
        >
          {trial.state === "invalid" ? `Undo: ${WORDS[outcome].toLowerCase()}` : WORDS[outcome]}
        </Button>
      ))}
      <ErrorNotice error={classify.error} />
    </>
  );
}

const rank = (outcome: Suggestion["outcome"], suggestion: Suggestion | null): number =>
  outcome === suggestion?.outcome ? 0 : 1;

function standsOut(outcome: Suggestion["outcome"], trial: Trial, suggestion: Suggestion | null): boolean {
  if (suggestion !== null) return outcome === suggestion.outcome;
  return outcome !== "invalid" && trial.state !== "invalid";
}

const LABELS = { "behaved badly": "Vehicle behaviour", "something else": "Other cause" } as const;

/** Whether an aborted flight counts against its gains, with buttons for the cause. */
export function AbortCause({ trial }: { trial: Trial }) {
  const judge = useJudgeAbort();
  const causes = abortWords(trial);
  const sentence = abortSentence(trial);
  if (sentence === "") return null;
  return (
    <section className={classes["abortCause"]} aria-label="Abort cause">
      <p role="status">{sentence}</p>
      {causes.length > 0 && (
        <Stack gap={8}>
          {trial.abort_cause !== "operator" && <small>Change the cause to:</small>}
          {causes.map((cause) => (
            <Button
              key={cause}
              variant="default"
              loading={judge.isPending}
              onClick={() => judge.mutate({ trial, cause })}
            >
              {LABELS[cause]}
            </Button>
          ))}
        </Stack>
      )}
      <ErrorNotice error={judge.error} />
    </section>
  );
}
