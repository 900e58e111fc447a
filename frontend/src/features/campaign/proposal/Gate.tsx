import { Button, Stack, TextInput } from "@mantine/core";
import { IconAlertTriangle, IconCircleCheck, IconCircleX } from "@tabler/icons-react";
import { Fragment, useState } from "react";
import { limitsOf, type Problem, reasonsOf } from "../../../api/problems";
import type { Check, Gate } from "../../../api/types";
import { count, gainText } from "../../../ui/format";
import { HelpTip } from "../../../ui/HelpTip";
import { Note } from "../../../ui/Note";
import classes from "../next-flight/NextFlight.module.css";

interface GateChecksProps {
  gate: Gate | null;
  /** Whether the result belongs to the gains shown. */
  isCurrent?: boolean;
}

/** Gate checks of a flight: a summary line, and each check when opened or when one has failed. */
export function GateChecks({ gate, isCurrent = true }: GateChecksProps) {
  if (gate === null || !isCurrent) {
    return (
      <Note className={classes["checking"] ?? ""} role="status">
        Running the gate checks…
      </Note>
    );
  }
  const refused = gate.checks.filter((check) => !check.passed).length;
  const summary =
    refused === 0
      ? `${count(gate.checks.length, "check")} passed`
      : gate.checks.length === 1
        ? "1 check failed"
        : `${refused} of ${gate.checks.length} checks failed`;
  return (
    <details className={classes["more"]} open={refused > 0}>
      <summary>{summary}</summary>
      <div>
        <ul className={classes["gate"]}>
          {gate.checks.map((check) => {
            const Icon = check.passed ? IconCircleCheck : IconCircleX;
            return (
              <li key={`${check.name} ${check.sentence}`} data-failed={!check.passed || undefined}>
                <Icon size={19} aria-label={check.passed ? "passed" : "failed"} />
                <span>
                  {check.sentence}
                  <Facts check={check} />
                </span>
              </li>
            );
          })}
        </ul>
        <Note fz="fine" mt={10}>
          Checked before every flight, for proposed and custom gains.
          <HelpTip topic="gate" />
        </Note>
      </div>
    </details>
  );
}

/** The worst case of the check, and values that would pass. */
function Facts({ check }: { check: Check }) {
  const offered = Object.entries(check.offer ?? {}).map(([name, value]) => `${name} ${gainText(value)}`);
  const parts = [
    check.case && !check.sentence.includes(check.case) ? `simulated with ${check.case}` : "",
    offered.length > 0 ? `would pass: ${offered.join(", ")}` : "",
  ].filter((part) => part !== "");
  return parts.length === 0 ? null : <small className="numbers">{parts.join(" · ")}</small>;
}

type Offer = [gain: string, value: number];

interface RefusalProps {
  problem: Problem;
  offers: Offer[];
  onUse: (offers: readonly Offer[]) => void;
}

/** Main reason of a refusal and values that would pass; other failed checks are collapsed. */
export function GateRefusal({ problem, offers, onUse }: RefusalProps) {
  const [first, ...reasons] = reasonsOf(problem);
  const limits = limitsOf(problem);
  const besides = limits.filter((limit) => limit !== first);
  const others = reasons.filter((reason) => !limits.includes(reason));
  return (
    <div className={`${classes["failed"]} ${classes["stack"]}`} role="alert">
      <div>
        <strong>{problem.detail || problem.title}</strong>
        <p>{first}</p>
      </div>
      {offers.length > 0 && (
        <div>
          <Button fullWidth variant="light" h="auto" onClick={() => onUse(offers)}>
            <span className={classes["offer"]}>
              Use{" "}
              {offers.map(([name, value], index) => (
                <Fragment key={name}>
                  {index > 0 && ", "}
                  <span>
                    {name} {gainText(value)}
                  </span>
                </Fragment>
              ))}
            </span>
          </Button>
          <OfferNote several={offers.length > 1} above={limits.includes(first ?? "")} besides={besides} />
        </div>
      )}
      {others.length > 0 && (
        <details className={classes["more"]}>
          <summary>{count(others.length, "more check")} failed</summary>
          <ul className={classes["gate"]}>
            {others.map((reason) => (
              <li key={reason}>{reason}</li>
            ))}
          </ul>
        </details>
      )}
      {problem.hint && <p className={classes["offerNote"]}>{problem.hint}</p>}
    </div>
  );
}

/** Explains why the offered values can be below those that the refusal names: several limits apply at once. */
function OfferNote({ several, above, besides }: { several: boolean; above: boolean; besides: readonly string[] }) {
  const nearest = several ? "The closest values to yours that satisfy" : "The closest value to yours that satisfies";
  const limits = above ? "the limit above and these:" : "these limits (the simulated checks are then repeated):";
  return (
    <>
      <p className={classes["offerNote"]}>
        {nearest} {besides.length > 0 ? limits : "the limit above."}
      </p>
      {besides.length > 0 && (
        <ul className={classes["offerNote"]}>
          {besides.map((limit) => (
            <li key={limit}>{limit}</li>
          ))}
        </ul>
      )}
    </>
  );
}

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
