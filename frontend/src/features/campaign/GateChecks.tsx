import { IconCircleCheck, IconCircleX } from "@tabler/icons-react";
import type { Check, Gate } from "../../api/types";
import { count, gainText } from "../../ui/format";
import { HelpTip } from "../../ui/HelpTip";
import { Note } from "../../ui/Note";
import classes from "./NextFlight.module.css";

/** Gate checks of a flight: a summary line, and each check when opened or when one has failed. */
export function GateChecks({ gate }: { gate: Gate }) {
  const refused = gate.checks.filter((check) => !check.passed).length;
  const summary =
    refused === 0
      ? `${count(gate.checks.length, "check")} passed`
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
          Checked before every flight, for proposed and manual gains.
          <HelpTip topic="gate" />
        </Note>
      </div>
    </details>
  );
}

/** The worst case of the check, and values that would pass. */
function Facts({ check }: { check: Check }) {
  const offered = Object.entries(check.offer ?? {}).map(([name, value]) => `${name} ${gainText(value)}`);
  const parts = [check.case ?? "", offered.length > 0 ? `would pass: ${offered.join(", ")}` : ""].filter(
    (part) => part !== "",
  );
  return parts.length === 0 ? null : <small className="numbers">{parts.join(" · ")}</small>;
}
