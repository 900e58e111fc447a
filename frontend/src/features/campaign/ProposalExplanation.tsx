import type { Explanation, FittedParameter } from "../../api/types";
import { gainText, NOTHING, withUnit } from "../../ui/format";
import { gainsInBrackets } from "../../ui/gains";
import { HelpTip } from "../../ui/HelpTip";
import { percent, plusMinus } from "../../ui/uncertainty";
import classes from "./NextFlight.module.css";

interface Props {
  explanation: Explanation;
  unit: string;
  gains: Readonly<Record<string, number>>;
}

/** Why these gains: the sentence, what was learned of the vehicle, what held the step back, and what it will teach. */
export function ProposalExplanation({ explanation, unit, gains }: Props) {
  const { clipped = [], notes = [], lesson = "", fitted = [], trust_fraction: trust = null } = explanation;
  return (
    <>
      <details className={classes["more"]}>
        <summary>Why these gains</summary>
        <div className={classes["stack"]}>
          <span>
            {explanation.summary} <HelpTip topic="bias" />
          </span>
          {lesson && (
            <span>
              <strong>What it will teach:</strong> {lesson}
            </span>
          )}
          {trust !== null && (
            <span className="numbers">
              Trusted region: {percent(trust)} of each gain's range
              <HelpTip topic="trustRegion" />
            </span>
          )}
          {clipped.length > 0 && <span>Stopped by a limit: {clipped.join(", ")}.</span>}
          {notes.map((note) => (
            <span key={note}>{note}</span>
          ))}
          {fitted.length > 0 && <Fitted parameters={fitted} />}
        </div>
      </details>
      <Tried explanation={explanation} unit={unit} gains={gains} />
    </>
  );
}

function withOwnUnit(text: string, unit: string): string {
  return unit === "" || unit === "1" ? text : `${text} (${unit})`;
}

/** What the flights say of the vehicle, beside what was known before them. */
function Fitted({ parameters }: { parameters: readonly FittedParameter[] }) {
  return (
    <table className={classes["ladder"]}>
      <caption>
        The vehicle as the flights have it (± standard error) <HelpTip topic="fitted" />
      </caption>
      {parameters.map(({ name, title, unit, value, standard_error, nominal, prior_sd }) => (
        <tbody key={name}>
          <tr>
            <th colSpan={2} scope="rowgroup">
              {withOwnUnit(title, unit)}
            </th>
          </tr>
          <tr className={classes["fitted"]}>
            <td>
              now <strong>{plusMinus(value, standard_error, "")}</strong>
            </td>
            <td>before {plusMinus(nominal, prior_sd, "")}</td>
          </tr>
        </tbody>
      ))}
    </table>
  );
}

/** The gradient and the steps tried along it, for those who want to follow the arithmetic. */
function Tried({ explanation, unit, gains }: Props) {
  const { gradient = {}, ladder = [], chosen_length: chosen } = explanation;
  const slopes = Object.entries(gradient);
  if (slopes.length === 0 && ladder.length === 0) return null;
  return (
    <details className={classes["more"]}>
      <summary>Steps tried on the model</summary>
      <div className={classes["stack"]}>
        {slopes.length > 0 && (
          <span className="numbers">
            Gradient of the error:{" "}
            {slopes.map(([name, value]) => `${name} ${value.toPrecision(2).replace("-", "−")}`).join(", ")} {unit} per
            unit of the gain. <HelpTip topic="gradient" />
          </span>
        )}
        {ladder.length > 0 && (
          // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
          <section className={`${classes["wide"]} sideways`} aria-label="Steps tried on the model" tabIndex={0}>
            <table className={classes["ladder"]}>
              <thead>
                <tr>
                  <th scope="col">Step</th>
                  <th scope="col">[{Object.keys(gains).join(" ")}]</th>
                  <th scope="col">Predicted</th>
                  <th scope="col">Limit</th>
                </tr>
              </thead>
              <tbody>
                {ladder.map((step) => (
                  <tr key={step.length} data-chosen={step.length === chosen || undefined}>
                    <td>{gainText(step.length)}</td>
                    <td>{gainsInBrackets(step.gains)}</td>
                    <td>{withUnit(step.predicted_error, unit, 4)}</td>
                    <td>{step.clipped?.join(", ") || NOTHING}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          </section>
        )}
      </div>
    </details>
  );
}
