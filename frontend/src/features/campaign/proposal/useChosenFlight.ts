import { useEffect, useLayoutEffect, useMemo, useState } from "react";
import { type GainSet, useEvaluation } from "../../../api/evaluation";
import { useCreateTrial } from "../../../api/mutations";
import { problemOf, reasonsByField } from "../../../api/problems";
import { useCatalogue } from "../../../api/queries";
import type { Campaign, Gain, GainsPrediction, Gate, Interval, NewTrial, Proposal } from "../../../api/types";
import { typed, typedGain } from "../../../ui/format";
import { scrollUpOnceBegun } from "../next-flight/nextStep";
import { type ChoiceName, preselected, trialOf } from "./choices";
import type { GainEntry } from "./GainTable";
import { gainRows, isOutside, readGains } from "./gainRows";

/** What the charts draw in place of the proposal. */
export interface Preview {
  /** Null while they cannot be read or lie outside their bounds. */
  gains: GainSet | null;
  prediction: GainsPrediction | null;
  /** False while it belongs to other gains than those chosen. */
  isCurrent: boolean;
}

export type ShowPreview = (preview: Preview | null) => void;

export type ChosenFlight = ReturnType<typeof useChosenFlight>;

/** Without `fly`, the flight is only planned. */
type FlightOrder = Pick<NewTrial, "fly" | "overrule">;

const NOTHING_PREDICTED = { predicted_error: null, interval: null, curve: null, lower: null, upper: null };
const NO_GAINS: readonly Gain[] = [];

interface PredictedError {
  predicted_error: number | null;
  interval: Interval | null;
}

/** What is known of the gains shown, or, while it is not current, of those before. */
interface Shown<Result> {
  result: Result | null;
  isCurrent: boolean;
}

function mapped(gains: GainSet, write: (gain: number) => string): Record<string, string> {
  return Object.fromEntries(Object.entries(gains).map(([name, value]) => [name, write(value)]));
}

/** The choice of what to fly next, with everything that belongs to its gains. A device with read-only access may not
 * request an evaluation of other gains than the proposed ones. */
export function useChosenFlight(campaign: Campaign, proposal: Proposal, onPreview: ShowPreview, isReadOnly: boolean) {
  const [name, setName] = useState(() => preselected(proposal));
  const [texts, setTexts] = useState(() => mapped(proposal.gains, typedGain));
  const [isEdited, setEdited] = useState(false);
  const experiment = useCatalogue().data?.experiments.find((one) => one.name === campaign.definition.experiment);
  const choice = proposal.choices.find(({ kind }) => kind === name);
  const known = experiment?.gains ?? NO_GAINS;
  const own = useMemo(() => readGains(texts, known), [texts, known]);
  const gains = choice === undefined ? own.gains : choice.gains;
  const isProposal = choice?.proposed === true;
  const asked = useEvaluation(campaign.id, proposal.id, isProposal || isReadOnly ? null : gains);
  const rows = gainRows(proposal, choice === undefined ? own.values : choice.gains, known, campaign.definition.bounds);
  const isOut = rows.some(isOutside);
  const { result, isCurrent } = asked.prediction;
  const predicted = useMemo(() => (isOut && result ? { ...result, ...NOTHING_PREDICTED } : result), [isOut, result]);
  const preview = useMemo(
    () => (isProposal ? null : { gains: isOut ? null : gains, prediction: predicted, isCurrent }),
    [isProposal, isOut, gains, predicted, isCurrent],
  );
  // An answer is drawn with the card that states it, before the next paint.
  useLayoutEffect(() => {
    if (preview?.isCurrent === true) onPreview(preview);
  }, [onPreview, preview]);
  useEffect(() => onPreview(preview), [onPreview, preview]);
  useEffect(() => () => onPreview(null), [onPreview]);
  const prediction: Shown<PredictedError> = isProposal
    ? { result: proposal, isCurrent: true }
    : { result: predicted, isCurrent };
  const gate: Shown<Gate> = isProposal ? { result: proposal.gate, isCurrent: true } : asked.gate;
  const error = isProposal ? null : (asked.prediction.error ?? asked.gate.error);
  const refusing = (gate.isCurrent && gate.result?.checks.filter(({ passed }) => !passed)) || [];
  const edit = (changed: Record<string, string>): void => {
    setTexts({ ...texts, ...changed });
    setEdited(true);
  };
  const entry: GainEntry = {
    texts,
    reasons: { ...reasonsByField(problemOf(error), Object.keys(texts)), ...own.reasons },
    refused: refusing.map((check) => check.gain),
    onText: (gain, text) => edit({ [gain]: text }),
  };
  const planning = useCreateTrial(campaign);
  const trial = trialOf(proposal, choice, gains ?? {});
  const isReady = gains !== null && gate.isCurrent && prediction.isCurrent && gate.result?.passed === true;
  return {
    name,
    /** Undefined for custom gains. */
    choice,
    choose: (next: ChoiceName) => {
      // Custom gains start from those shown, and are kept once they were edited.
      if (next === "own" && choice !== undefined && !isEdited) setTexts(mapped(choice.gains, typedGain));
      setName(next);
    },
    rows,
    /** For custom gains only. */
    entry: choice === undefined ? entry : undefined,
    /** Null while what is typed are no numbers. */
    gains,
    prediction,
    gate,
    error,
    /** Replaces some of the custom gains. */
    use: (offered: GainSet) => edit(mapped(offered, typed)),
    /** The trial of these gains; undefined until they have been predicted and have passed the gate. */
    trial: isReady ? trial : undefined,
    planning,
    plan: () => planning.mutate(trial),
    /** Plans it as ordered, then shows the top of the page. */
    fly: (order: FlightOrder) => scrollUpOnceBegun(planning.mutateAsync({ ...trial, ...order })),
  };
}
