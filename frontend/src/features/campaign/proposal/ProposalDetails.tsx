import { Group } from "@mantine/core";
import { IconFlagCheck, IconHome, IconRepeat, IconStairsUp } from "@tabler/icons-react";
import type { Explanation, FittedParameter, Proposal } from "../../../api/types";
import { Aside } from "../../../ui/Aside";
import { against, gainText, NOTHING, percentChange, trueMinus, withUnit } from "../../../ui/format";
import { gainsInBrackets } from "../../../ui/gains";
import { HelpTip } from "../../../ui/HelpTip";
import { ListTable } from "../../../ui/ListTable";
import { Note } from "../../../ui/Note";
import { intervalText, percent, plusMinus } from "../../../ui/uncertainty";
import { CHOICES, type ChoiceName, isDoubtful } from "./choices";
import { Landscape } from "./Landscape";
import { More } from "./More";
import classes from "./Proposal.module.css";
import type { ChosenFlight } from "./useChosenFlight";

interface PredictedErrorProps {
  prediction: ChosenFlight["prediction"];
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
export function PredictedError({ prediction, best, bestTitle, source, unit, hasModel }: PredictedErrorProps) {
  const { result, isCurrent } = prediction;
  const { predicted_error: error = null, interval = null } = result ?? {};
  const change = percentChange(error, best);
  if (error === null && isCurrent) {
    return (
      <Note fz="body" className={hasModel ? "" : classes["later"]}>
        {unpredicted(best, hasModel)}
      </Note>
    );
  }
  return (
    <Group
      gap="0 10px"
      align="baseline"
      justify="space-between"
      className={classes["predicted"] ?? ""}
      aria-busy={!isCurrent}
    >
      <Group gap={6} wrap="nowrap">
        {isCurrent ? "Predicted error" : "Updating…"}
        <HelpTip topic="predicted" />
      </Group>
      <strong className="quantity">{withUnit(error, unit)}</strong>
      {interval && (
        <small>
          {intervalText(interval, unit)}
          <HelpTip topic="interval" />
        </small>
      )}
      {isCurrent && source && <small>{source}</small>}
      {change !== null && <small>{against(change, bestTitle)}</small>}
    </Group>
  );
}

const ICONS = { step: IconStairsUp, repeat: IconRepeat, baseline: IconHome, stop: IconFlagCheck } as const;

interface ReasonProps {
  proposal: Proposal;
  chosen: ChoiceName;
  isFirst: boolean;
}

/** Why these gains: the advice where they are recommended, or to stop, otherwise what the choice is for. A warning and
 * the advice to stop come before the button on every screen. */
export function Reason({ proposal, chosen, isFirst }: ReasonProps) {
  const { kind, why } = proposal.advice;
  const isStop = kind === "stop";
  const isRecommended = proposal.choices.some(({ kind: one, recommended }) => recommended && one === chosen);
  if (chosen === "own" ? !isStop : isFirst && isRecommended) return null;
  if (isDoubtful(proposal)) {
    return (
      <Aside tone="warn" fz="small">
        {isStop && <strong>Recommended: stop the campaign. </strong>}
        {why}
      </Aside>
    );
  }
  const later = classes["later"];
  const { hint } = CHOICES[chosen];
  if (!isStop && !(isRecommended && proposal.gate.passed)) {
    return (
      <Note fz="body" className={later}>
        {isRecommended ? why : hint}
      </Note>
    );
  }
  const Icon = ICONS[kind];
  return (
    <Aside tone="good" className={isStop ? "" : later} fz="small">
      <Group wrap="nowrap" gap={10} align="start">
        <Icon size={22} color="var(--best)" aria-hidden />
        <div>
          {isStop && <strong>Recommended: stop the campaign</strong>}
          <p>{why || hint}</p>
        </div>
      </Group>
    </Aside>
  );
}

interface ProposalDetailsProps {
  proposal: Proposal;
  campaignId: number;
  /** What the card says already. */
  said: string;
  unit: string;
  hasModel: boolean;
}

/** Details of the proposed gains: why these, what the model says of others, and the steps evaluated on it. */
export function ProposalDetails({ proposal, campaignId, said, unit, hasModel }: ProposalDetailsProps) {
  const { explanation, gains } = proposal;
  const { clipped, notes, lesson, fitted, trust_fraction: trust } = explanation;
  const summary = said.includes(explanation.summary) ? "" : explanation.summary;
  const isModelled = Object.keys(explanation.gradient).length > 0 || fitted.length > 0;
  const isExplained = hasModel || notes.length > 0 || lesson !== "" || summary !== "";
  return (
    <>
      {isExplained && (
        <More summary="Explanation">
          {summary && <span>{summary}</span>}
          {lesson && (
            <span>
              <strong>What this flight will show:</strong> {lesson}
            </span>
          )}
          {trust !== null && (
            <span>
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
          {hasModel && <Landscape campaignId={campaignId} />}
        </More>
      )}
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
    <div>
      <Note fz="fine">
        Fitted parameters (± standard error) <HelpTip topic="fitted" />
      </Note>
      <dl>
        {parameters.map(({ name, title, unit, value, standard_error, nominal, prior_sd }) => (
          <div key={name}>
            <dt>{withOwnUnit(title, unit)}</dt>
            <Group component="dd" gap="0 12px" justify="space-between" fz="fine">
              <span>
                fitted <strong>{plusMinus(value, standard_error, "")}</strong>
              </span>
              <span>prior {plusMinus(nominal, prior_sd, "")}</span>
            </Group>
          </div>
        ))}
      </dl>
    </div>
  );
}

interface TriedProps {
  explanation: Explanation;
  unit: string;
  gains: Proposal["gains"];
}

/** The gradient, and the steps evaluated along it. */
function Tried({ explanation, unit, gains }: TriedProps) {
  const { gradient, ladder, chosen_length: chosen } = explanation;
  const slopes = Object.entries(gradient);
  if (slopes.length + ladder.length === 0) return null;
  return (
    <More summary={ladder.length > 0 ? "Steps evaluated on the model" : "Gradient of the error"}>
      {slopes.length > 0 && (
        <span>
          Gradient of the error:{" "}
          {slopes.map(([name, value]) => `${name} ${trueMinus(value.toPrecision(2))}`).join(", ")} {unit} per unit of
          the gain. <HelpTip topic="gradient" />
        </span>
      )}
      {ladder.length > 0 && (
        <ListTable
          label="Steps evaluated on the model"
          className={classes["ladder"]}
          rows={ladder}
          keyOf={({ length }) => String(length)}
          marks={({ length }) => ({ "data-chosen": length === chosen || undefined })}
          columns={[
            { title: "Step", cell: ({ length }) => gainText(length) },
            { title: `[${Object.keys(gains).join(" ")}]`, cell: (step) => gainsInBrackets(step.gains) },
            { title: "Predicted", cell: ({ predicted_error }) => withUnit(predicted_error, unit) },
            { title: "Limit", cell: ({ clipped }) => clipped.join(", ") || NOTHING },
          ]}
        />
      )}
    </More>
  );
}
