import { Button, Chip, Group, Stack, Text, TextInput } from "@mantine/core";
import { useState } from "react";
import { useClassify, useJudgeAbort } from "../../../api/mutations";
import { problemOf, reasonsByField } from "../../../api/problems";
import type { Campaign, Trial } from "../../../api/types";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import classes from "./FlightReview.module.css";
import {
  abortSentence,
  abortWords,
  consequenceOf,
  type FlightClass,
  INVALID_REASONS,
  otherClasses,
  suggestedClass,
} from "./review";

const WORDS = { valid: "Mark valid", aborted: "Mark aborted", invalid: "Mark invalid" } as const;

/** A question within a panel. */
const BOX = { gap: 12, w: "100%", p: 14, bg: "var(--sunken)", bdrs: "md" };

const showWhole = (form: HTMLElement | null) => form?.scrollIntoView({ block: "nearest" });

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
  const classify = useClassify(trial);
  const isEndedByRule = campaign?.state === "finished" && campaign.outcome !== "stopped";
  const suggestion = suggestedClass(trial);
  const isSuggested = (outcome: FlightClass) => outcome === suggestion?.outcome;
  const others = otherClasses(trial).sort((one, other) => Number(isSuggested(other)) - Number(isSuggested(one)));
  if (others.length === 0) return null;
  const standsOut = (outcome: FlightClass) =>
    suggestion === null ? outcome !== "invalid" && trial.state !== "invalid" : isSuggested(outcome);

  function choose(outcome: FlightClass): void {
    if (outcome === "invalid" && !isSuggested(outcome)) {
      setAsking(true);
      return;
    }
    const by = trial.state === "invalid" ? "restored by the operator" : "reviewed by the operator";
    classify.mutate({ outcome, reason: (outcome === "invalid" && suggestion?.why) || by });
  }

  if (asking) {
    return (
      <Stack
        component="form"
        ref={showWhole}
        {...BOX}
        onSubmit={(event) => {
          event.preventDefault();
          classify.mutate({ outcome: "invalid", reason });
        }}
      >
        <Note fz="body">
          The record of an invalid flight is kept, but not used for any computation.{" "}
          <strong>{consequenceOf(trial, trials, "invalid")}</strong>
          {isEndedByRule && " The campaign reopens if its stop rule is no longer met."} Why is it invalid?
        </Note>
        <Chip.Group value={reason} onChange={(value) => setReason(value)}>
          <Group gap={8}>
            {INVALID_REASONS.map((one) => (
              <Chip key={one} value={one} variant="outline" classNames={{ label: classes["chip"] }}>
                {one}
              </Chip>
            ))}
          </Group>
        </Chip.Group>
        <TextInput
          label="Reason"
          value={reason}
          maxLength={500}
          error={reasonsByField(problemOf(classify.error), ["reason"])["reason"]}
          onChange={(event) => setReason(event.currentTarget.value)}
        />
        <Group grow gap={8}>
          <Button type="submit" color="red" disabled={reason.trim() === ""} loading={classify.isPending}>
            Mark invalid
          </Button>
          <Button variant="default" onClick={() => setAsking(false)}>
            Cancel
          </Button>
        </Group>
        <ErrorNotice error={classify.error} shown={["reason"]} />
      </Stack>
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
          variant={standsOut(outcome) ? "filled" : "default"}
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

const LABELS = { "behaved badly": "Vehicle behaviour", "something else": "Other cause" } as const;

/** Whether an aborted flight counts against its gains, with buttons for the cause. */
export function AbortCause({ trial }: { trial: Trial }) {
  const judge = useJudgeAbort(trial);
  const causes = abortWords(trial);
  const sentence = abortSentence(trial);
  if (sentence === "") return null;
  return (
    <Stack component="section" {...BOX} aria-label="Abort cause">
      <Text fz="body" role="status">
        {sentence}
      </Text>
      {causes.length > 0 && (
        <Stack gap={8}>
          {trial.abort_cause !== "operator" && <small>Change the cause to:</small>}
          {causes.map((cause) => (
            <Button key={cause} variant="default" loading={judge.isPending} onClick={() => judge.mutate(cause)}>
              {LABELS[cause]}
            </Button>
          ))}
        </Stack>
      )}
      <ErrorNotice error={judge.error} />
    </Stack>
  );
}
