import { IconCircleCheck, IconCircleX } from "@tabler/icons-react";
import type { Explanation, Gate } from "../api/types";
import { count, gainText, withUnit } from "../lib/format";
import { gainsInBrackets } from "../lib/gains";
import classes from "./NextFlight.module.css";

/** Why these gains: the sentence, the gradient, the ladder of steps tried, and what a limit stopped. */
export function Why({ explanation, unit }: { explanation: Explanation; unit: string }) {
  const { gradient = {}, ladder = [], clipped = [], notes = [], chosen_length: chosen } = explanation;
  return (
    <details className={classes["more"]}>
      <summary>Why these gains</summary>
      <div className={classes["stack"]}>
        <span>{explanation.summary}</span>
        {Object.keys(gradient).length > 0 && (
          <span className="numbers">
            Gradient of the error:{" "}
            {Object.entries(gradient)
              .map(([name, value]) => `${name} ${value.toPrecision(2)}`)
              .join(", ")}{" "}
            {unit} per count.
          </span>
        )}
        {clipped.length > 0 && <span>Stopped by a limit: {clipped.join(", ")}.</span>}
        {notes.map((note) => (
          <span key={note}>{note}</span>
        ))}
        {ladder.length > 0 && (
          <table className={classes["ladder"]}>
            <caption className="visually-hidden">Steps tried on the model</caption>
            <thead>
              <tr>
                <th scope="col">Step</th>
                <th scope="col">Gains</th>
                <th scope="col">Predicted</th>
              </tr>
            </thead>
            <tbody>
              {ladder.map((step) => (
                <tr key={step.length} data-chosen={step.length === chosen || undefined}>
                  <td>{gainText(step.length)}</td>
                  <td>{gainsInBrackets(step.gains)}</td>
                  <td>{withUnit(step.predicted_error, unit, 4)}</td>
                </tr>
              ))}
            </tbody>
          </table>
        )}
      </div>
    </details>
  );
}

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
                <span>{check.sentence}</span>
              </li>
            );
          })}
        </ul>
      </div>
    </details>
  );
}
