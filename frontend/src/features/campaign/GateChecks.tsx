import { IconCircleCheck, IconCircleX } from "@tabler/icons-react";
import type { Check, Gate } from "../../api/types";
import { count, gainText } from "../../ui/format";
import { HelpTip } from "../../ui/HelpTip";
import classes from "./NextFlight.module.css";

/** What was checked before the flight: one line when all is well, each check when opened or when one refused. */
export function GateChecks({ gate }: { gate: Gate }) {
  const refused = gate.checks.filter((check) => !check.passed).length;
  const said =
    refused === 0
      ? `${count(gate.checks.length, "check")} passed`
      : `${refused} of ${gate.checks.length} checks refused`;
  return (
    <details className={classes["more"]} open={refused > 0}>
      <summary>{said}</summary>
      <div>
        <ul className={classes["gate"]}>
          {gate.checks.map((check) => {
            const Icon = check.passed ? IconCircleCheck : IconCircleX;
            return (
              <li key={`${check.name} ${check.sentence}`} data-failed={!check.passed || undefined}>
                <Icon size={19} aria-label={check.passed ? "passed" : "refused"} />
                <span>
                  {check.sentence}
                  <Facts check={check} />
                </span>
              </li>
            );
          })}
        </ul>
        <p className={classes["gateNote"]}>
          Judged before every flight, whoever chose the gains.
          <HelpTip topic="gate" />
        </p>
      </div>
    </details>
  );
}

/** The case that gave the worst number, and what would pass; the number itself stands in the sentence. */
function Facts({ check }: { check: Check }) {
  const offered = Object.entries(check.offer ?? {}).map(([name, value]) => `${name} ${gainText(value)}`);
  const parts = [check.case ?? "", offered.length > 0 ? `would pass: ${offered.join(", ")}` : ""].filter(
    (part) => part !== "",
  );
  return parts.length === 0 ? null : <small className="numbers">{parts.join(" · ")}</small>;
}
