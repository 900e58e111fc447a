import { useEffect, useLayoutEffect, useMemo, useState } from "react";
import { type GainSet, useEvaluation } from "../../../api/evaluation";
import { useCreateTrial } from "../../../api/mutations";
import { problemOf, reasonsByField } from "../../../api/problems";
import { useCatalogue } from "../../../api/queries";
import type {
  Campaign,
  FlightChoice,
  Gain,
  GainsPrediction,
  Gate,
  Interval,
  NewTrial,
  Proposal,
} from "../../../api/types";
import { typed, typedGain } from "../../../ui/format";
import { watched } from "../next-flight/nextStep";
import { type ChoiceName, preselected, trialOf } from "./choices";
import type { GainEntry } from "./GainTable";
import { type GainRow, gainRows, isOutside, readGains } from "./gainRows";

/** What the charts draw in place of the proposal. */
export interface Preview {
  /** Null while they cannot be read or lie outside their bounds. */
  gains: GainSet | null;
  prediction: GainsPrediction | null;
  /** False while it belongs to other gains than those chosen. */
  isCurrent: boolean;
}

export type ShowPreview = (preview: Preview | null) => void;

interface PredictedError {
  predicted_error: number | null;
  interval: Interval | null;
}

export interface ChosenFlight {
  name: ChoiceName;
  /** Undefined for custom gains. */
  choice: FlightChoice | undefined;
  choose: (name: ChoiceName) => void;
  rows: GainRow[];
  entry: GainEntry | undefined;
  /** Null while what is typed are no numbers. */
  gains: GainSet | null;
  /** Prediction and gate result, and whether they belong to these gains. */
  predicted: PredictedError | null;
  isPredicted: boolean;
  gate: Gate | null;
  isChecked: boolean;
  error: unknown;
  /** Replaces some of the custom gains. */
  use: (gains: GainSet) => void;
  /** The trial of these gains; undefined until they have been predicted and have passed the gate. */
  trial: NewTrial | undefined;
  plan: () => void;
  /** Plans it as ordered, then shows the top of the page. */
  fly: (order: FlightOrder) => void;
  isPlanning: boolean;
  planError: unknown;
}

/** Without `fly`, the flight is only planned. */
type FlightOrder = Pick<NewTrial, "fly" | "overrule">;

const NOTHING_PREDICTED = { predicted_error: null, interval: null, curve: null, lower: null, upper: null };
const NO_GAINS: readonly Gain[] = [];

function typedGains(gains: GainSet): Record<string, string> {
  return Object.fromEntries(Object.entries(gains).map(([name, value]) => [name, typedGain(value)]));
}

/** The choice of what to fly next, with everything that belongs to its gains. A device with read-only access may not
 * request an evaluation of other gains than the proposed ones. */
export function useChosenFlight(
  campaign: Campaign,
  proposal: Proposal,
  onPreview: ShowPreview,
  isReadOnly: boolean,
): ChosenFlight {
  const [name, setName] = useState(() => preselected(proposal));
  const [texts, setTexts] = useState(() => typedGains(proposal.gains));
  const [isEdited, setEdited] = useState(false);
  const experiment = useCatalogue().data?.experiments.find((one) => one.name === campaign.definition.experiment);
  const choice = proposal.choices.find(({ kind }) => kind === name);
  const known = experiment?.gains ?? NO_GAINS;
  const own = useMemo(() => readGains(texts, known), [texts, known]);
  const gains = choice === undefined ? own.gains : choice.gains;
  const isProposal = choice?.proposed === true;
  const { prediction, gate } = useEvaluation(campaign.id, proposal.id, isProposal || isReadOnly ? null : gains);
  const rows = gainRows(
    proposal,
    choice === undefined ? own.values : choice.gains,
    known,
    campaign.definition.bounds ?? {},
  );
  const isUnpredicted = rows.some(isOutside);
  const predicted = useMemo(
    () => (isUnpredicted && prediction.result ? { ...prediction.result, ...NOTHING_PREDICTED } : prediction.result),
    [isUnpredicted, prediction.result],
  );
  const preview = useMemo(
    () =>
      isProposal
        ? null
        : { gains: isUnpredicted ? null : gains, prediction: predicted, isCurrent: prediction.isCurrent },
    [isProposal, isUnpredicted, gains, predicted, prediction.isCurrent],
  );
  // An answer is drawn with the card that states it, before the next paint.
  useLayoutEffect(() => {
    if (preview?.isCurrent === true) onPreview(preview);
  }, [onPreview, preview]);
  useEffect(() => onPreview(preview), [onPreview, preview]);
  useEffect(() => () => onPreview(null), [onPreview]);
  const error = isProposal ? null : (prediction.error ?? gate.error);
  const reasons = { ...reasonsByField(problemOf(error), Object.keys(texts)), ...own.reasons };
  const refused = (gate.isCurrent ? (gate.result?.checks ?? []) : []).flatMap(({ passed, gain }) =>
    passed || !gain ? [] : [gain],
  );
  const edit = (changed: Record<string, string>): void => {
    setTexts({ ...texts, ...changed });
    setEdited(true);
  };
  const create = useCreateTrial(campaign);
  const isPredicted = isProposal || prediction.isCurrent;
  const shownGate = isProposal ? proposal.gate : gate.result;
  const isChecked = isProposal || gate.isCurrent;
  const trial = trialOf(proposal, choice, gains ?? {});
  const isReady = gains !== null && isChecked && isPredicted && shownGate?.passed === true;
  return {
    name,
    choice,
    choose: (next) => {
      // Custom gains start from those shown, and are kept once they were edited.
      if (next === "own" && choice !== undefined && !isEdited) setTexts(typedGains(choice.gains));
      setName(next);
    },
    rows,
    entry:
      choice === undefined ? { texts, reasons, refused, onText: (gain, text) => edit({ [gain]: text }) } : undefined,
    gains,
    predicted: isProposal ? proposal : predicted,
    isPredicted,
    gate: shownGate,
    isChecked,
    error,
    use: (offers) => edit(Object.fromEntries(Object.entries(offers).map(([gain, value]) => [gain, typed(value)]))),
    trial: isReady ? trial : undefined,
    plan: () => create.mutate(trial),
    fly: (order) => watched(create.mutateAsync({ ...trial, ...order })),
    isPlanning: create.isPending,
    planError: create.error,
  };
}
