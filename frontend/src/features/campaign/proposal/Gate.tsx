import { Button, Group, Stack, Text, TextInput } from "@mantine/core";
import { IconAlertTriangle, IconCircleCheck, IconCircleX } from "@tabler/icons-react";
import { useState } from "react";
import type { GainSet } from "../../../api/evaluation";
import type { Check, Gate } from "../../../api/types";
import { count, gainText } from "../../../ui/format";
import { HelpTip } from "../../../ui/HelpTip";
import { Note } from "../../../ui/Note";
import notices from "../../../ui/Notices.module.css";
import page from "../CampaignPage.module.css";
import { More } from "./More";
import classes from "./Proposal.module.css";

/** Gate checks of a flight: a summary line, and each check when opened or when one has failed. Null while they run. */
export function GateChecks({ gate }: { gate: Gate | null }) {
  if (gate === null) {
    return (
      <Note className={classes["more"]} mih={48} pt={12} role="status">
        Running the gate checks…
      </Note>
    );
  }
  const all = gate.checks.length;
  const refused = gate.checks.filter((check) => !check.passed).length;
  const summary =
    refused === 0 ? `${count(all, "check")} passed` : `${all === 1 ? "1 check" : `${refused} of ${all} checks`} failed`;
  return (
    <More summary={summary} open={refused > 0}>
      <Stack component="ul" gap={6} lh={1.4}>
        {gate.checks.map((check) => {
          const [Icon, result, color] = check.passed
            ? [IconCircleCheck, "passed", "var(--best)"]
            : [IconCircleX, "failed", "var(--bad)"];
          return (
            <Group key={`${check.name} ${check.sentence}`} component="li" gap={8} wrap="nowrap" align="start">
              <Icon size={19} color={color} aria-label={result} />
              <div>
                {check.sentence}
                <Note fz="fine" lh="inherit">
                  {factsOf(check)}
                </Note>
              </div>
            </Group>
          );
        })}
      </Stack>
      <Note fz="fine">
        Checked before every flight, for proposed and custom gains.
        <HelpTip topic="gate" />
      </Note>
    </More>
  );
}

function named(gains: GainSet): string {
  return Object.entries(gains)
    .map(([name, value]) => `${name} ${gainText(value)}`.replaceAll(" ", "\u00a0"))
    .join(", ");
}

/** The worst case of the check, and values that would pass. */
function factsOf({ case: worst, sentence, offer }: Check): string {
  const offered = named(offer);
  return [worst && !sentence.includes(worst) ? `simulated with ${worst}` : "", offered && `would pass: ${offered}`]
    .filter((part) => part !== "")
    .join(" · ");
}

function sentencesOf(checks: readonly Check[]): string[] {
  return [...new Set(checks.map(({ sentence }) => sentence))];
}

interface RefusalProps {
  gate: Gate;
  /** Takes over gains that would pass; undefined where none can be entered. */
  onUse: ((gains: GainSet) => void) | undefined;
}

/** Main reason of a refusal and values that would pass; other failed checks are collapsed. */
export function GateRefusal({ gate, onUse }: RefusalProps) {
  const failed = gate.checks.filter(({ passed }) => !passed);
  const offering = failed.filter(({ offer }) => Object.keys(offer).length > 0);
  const offer: GainSet = Object.assign({}, ...offering.map((check) => check.offer));
  const [first = "", ...reasons] = sentencesOf(failed);
  const limits = sentencesOf(offering);
  const others = reasons.filter((reason) => !limits.includes(reason));
  return (
    <div className={notices["notice"]} role="alert">
      <Stack gap={14} flex={1} miw={0}>
        <div>
          <strong>The gate refuses these gains.</strong>
          <p>{first}</p>
        </div>
        {onUse && limits.length > 0 && (
          <div>
            <Button fullWidth variant="light" className={page["wrapping"]} onClick={() => onUse(offer)}>
              Use {named(offer)}
            </Button>
            <OfferNote several={Object.keys(offer).length > 1} first={first} limits={limits} />
          </div>
        )}
        {others.length > 0 && (
          <More summary={`${count(others.length, "more check")} failed`}>
            <ul>
              {others.map((reason) => (
                <li key={reason}>{reason}</li>
              ))}
            </ul>
          </More>
        )}
        {onUse === undefined && <small>Select custom gains to fly others.</small>}
      </Stack>
    </div>
  );
}

interface OfferNoteProps {
  several: boolean;
  /** The limit that the refusal names, if it is one of them. */
  first: string;
  limits: readonly string[];
}

/** Explains why the offered values can be below those that the refusal names: several limits apply at once. */
function OfferNote({ several, first, limits }: OfferNoteProps) {
  const besides = limits.filter((limit) => limit !== first);
  const nearest = several ? "The closest values to yours that satisfy" : "The closest value to yours that satisfies";
  if (besides.length === 0) return <p>{nearest} the limit above.</p>;
  const these = limits.includes(first)
    ? "the limit above and these:"
    : "these limits (the simulated checks are then repeated):";
  return (
    <Text component="div" fz="fine" mt={8}>
      {nearest} {these}
      <ul>
        {besides.map((limit) => (
          <li key={limit}>{limit}</li>
        ))}
      </ul>
    </Text>
  );
}

/** Simulations only: fly gains that the gate refuses, with a reason that is stored with the flight. */
export function OverruleGate({ pending, onFly }: { pending: boolean; onFly: (reason: string) => void }) {
  const [reason, setReason] = useState("");
  return (
    <More summary="Overrule the gate">
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
    </More>
  );
}
