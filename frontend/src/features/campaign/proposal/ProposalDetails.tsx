import { Stack } from "@mantine/core";
import { IconFlagCheck, IconHome, IconRepeat, IconStairsUp } from "@tabler/icons-react";
import type { Explanation, FittedParameter, Interval, Proposal } from "../../../api/types";
import { Aside } from "../../../ui/Aside";
import { against, gainText, NOTHING, percentChange, withUnit } from "../../../ui/format";
import { gainsInBrackets } from "../../../ui/gains";
import { HelpTip } from "../../../ui/HelpTip";
import { Note } from "../../../ui/Note";
import { intervalText, percent, plusMinus } from "../../../ui/uncertainty";
import classes from "../next-flight/NextFlight.module.css";
import { CHOICES, type ChoiceName, isDoubtful } from "./choices";

interface PredictedErrorProps {
  predicted: { predicted_error: number | null; interval: Interval | null } | null;
  /** Whether the prediction belongs to the gains shown. */
  isCurrent: boolean;
  /** Mean error of the best gains; null if nothing is to be compared with it. */
  best: number | null;
  /** Whose error that is. */
  bestTitle: string;
  /** What the prediction is, if it is no model's. */
  source: string;
  unit: string;
  /** Whether there is a model of the controller. */
  hasModel: boolean;
}

function unpredicted(best: number | null, hasModel: boolean): string {
  if (!hasModel) return "No predicted error: Gainline has no model of this controller.";
  return best === null
    ? "No predicted error: before the first valid flight, the model is too uncertain for these gains."
    : "No prediction for these gains.";
}

/** Predicted error with its interval; grey while it belongs to other gains. */
export function PredictedError({ predicted, isCurrent, best, bestTitle, source, unit, hasModel }: PredictedErrorProps) {
  const { predicted_error: error = null, interval = null } = predicted ?? {};
  const change = percentChange(error, best);
  if (error === null && isCurrent) return <Note fz="body">{unpredicted(best, hasModel)}</Note>;
  return (
    <div className={`${classes["predicted"]} numbers`} data-stale={!isCurrent || undefined} aria-busy={!isCurrent}>
      <span>
        {isCurrent ? "Predicted error" : "Updating…"}
        <HelpTip topic="predicted" />
      </span>
      <span>
        <strong>{withUnit(error, unit)}</strong>
        {interval && (
          <small>
            {intervalText(interval, unit)}
            <HelpTip topic="interval" />
          </small>
        )}
        {isCurrent && source && <small>{source}</small>}
        {change !== null && <small>{against(change, bestTitle)}</small>}
      </span>
    </div>
  );
}

const ICONS = { step: IconStairsUp, repeat: IconRepeat, baseline: IconHome, stop: IconFlagCheck } as const;

interface ReasonProps {
  proposal: Proposal;
  chosen: ChoiceName;
  isFirst: boolean;
}

/** Why these gains: the advice where they are recommended, or to stop, otherwise what the choice is for. */
export function Reason({ proposal, chosen, isFirst }: ReasonProps) {
  const { kind, why } = proposal.advice;
  const isRecommended = proposal.choices.some(({ kind: one, recommended }) => recommended && one === chosen);
  if (chosen === "own" ? kind !== "stop" : isFirst && isRecommended) return null;
  if (isDoubtful(proposal)) {
    return (
      <Aside tone="warn" fz="small">
        {kind === "stop" && <strong>Recommended: stop the campaign. </strong>}
        {why}
      </Aside>
    );
  }
  const isRefused = isRecommended && chosen !== "own" && !proposal.gate.passed;
  if (isRefused) return <Note fz="body">{why}</Note>;
  if (!isRecommended && kind !== "stop") return <Note fz="body">{CHOICES[chosen].hint}</Note>;
  const Icon = ICONS[kind];
  return (
    <Aside tone="good" className={classes["advice"] ?? ""} data-kind={kind}>
      <Icon size={22} color="var(--best)" aria-hidden />
      <p>
        {kind === "stop" && <strong>Recommended: stop the campaign</strong>}
        <span>{why || CHOICES[chosen].hint}</span>
      </p>
    </Aside>
  );
}

interface ProposalExplanationProps {
  explanation: Explanation;
  /** What the card says already. */
  said: string;
  unit: string;
  gains: Readonly<Record<string, number>>;
}

/** Explanation of the proposed gains: summary, expected information, trust region, limits, fitted parameters. */
export function ProposalExplanation({ explanation, said, unit, gains }: ProposalExplanationProps) {
  const { clipped = [], notes = [], lesson = "", fitted = [], trust_fraction: trust = null } = explanation;
  const summary = said.includes(explanation.summary) ? [] : [explanation.summary];
  const isModelled = Object.keys(explanation.gradient ?? {}).length > 0 || fitted.length > 0;
  if (!isModelled && lesson === "" && summary.length + notes.length === 0) return null;
  return (
    <>
      <details className={classes["more"]}>
        <summary>Explanation</summary>
        <Stack gap={14}>
          {summary.map((sentence) => (
            <span key={sentence}>{sentence}</span>
          ))}
          {lesson && (
            <span>
              <strong>What this flight will show:</strong> {lesson}
            </span>
          )}
          {trust !== null && (
            <span className="numbers">
              Trust region: {percent(trust)} of each gain's range
              <HelpTip topic="trustRegion" />
            </span>
          )}
          {clipped.length > 0 && <span>Limited by: {clipped.join(", ")}.</span>}
          {notes.map((note, index) => (
            <span key={note}>
              {note} {index === 0 && isModelled && <HelpTip topic="bias" />}
            </span>
          ))}
          {fitted.length > 0 && <Fitted parameters={fitted} />}
        </Stack>
      </details>
      <Tried explanation={explanation} unit={unit} gains={gains} />
    </>
  );
}

function withOwnUnit(text: string, unit: string): string {
  return unit === "" || unit === "1" ? text : `${text} (${unit})`;
}

/** Fitted parameters of the vehicle, next to their values before the flights. */
function Fitted({ parameters }: { parameters: readonly FittedParameter[] }) {
  return (
    <table className={classes["ladder"]}>
      <caption>
        Fitted parameters (± standard error) <HelpTip topic="fitted" />
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
              fitted <strong>{plusMinus(value, standard_error, "")}</strong>
            </td>
            <td>prior {plusMinus(nominal, prior_sd, "")}</td>
          </tr>
        </tbody>
      ))}
    </table>
  );
}

/** Details: the gradient, and the steps evaluated along it. */
function Tried({ explanation, unit, gains }: Omit<ProposalExplanationProps, "said">) {
  const { gradient = {}, ladder = [], chosen_length: chosen } = explanation;
  const slopes = Object.entries(gradient);
  if (slopes.length === 0 && ladder.length === 0) return null;
  return (
    <details className={classes["more"]}>
      <summary>{ladder.length > 0 ? "Steps evaluated on the model" : "Gradient of the error"}</summary>
      <Stack gap={14}>
        {slopes.length > 0 && (
          <span className="numbers">
            Gradient of the error:{" "}
            {slopes.map(([name, value]) => `${name} ${value.toPrecision(2).replace("-", "−")}`).join(", ")} {unit} per
            unit of the gain. <HelpTip topic="gradient" />
          </span>
        )}
        {ladder.length > 0 && (
          // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
          <section className={`${classes["wide"]} sideways`} aria-label="Steps evaluated on the model" tabIndex={0}>
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
                    <td>{withUnit(step.predicted_error, unit)}</td>
                    <td>{step.clipped?.join(", ") || NOTHING}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          </section>
        )}
      </Stack>
    </details>
  );
}
