/** Prediction and gate result of gains that are considered for the next flight. */

import { useDebouncedValue } from "@mantine/hooks";
import { hashKey, keepPreviousData, useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { answer } from "./client";
import { evaluateGate, predictGains } from "./generated";
import type { GainsPrediction, Gate } from "./types";

export type GainSet = Readonly<Record<string, number>>;

function areSame(one: GainSet | null, other: GainSet | null): boolean {
  return hashKey([one]) === hashKey([other]);
}

interface Evaluated<Result> {
  /** The latest answer, possibly for earlier gains. */
  result: Result | null;
  /** Whether the answer is for the gains asked for. */
  isCurrent: boolean;
  error: unknown;
}

/** One request at a time: while one is answered, only the latest gains wait for the next. */
function useEvaluated<Result>(
  key: readonly (string | number)[],
  gains: GainSet | null,
  evaluate: (gains: GainSet) => Promise<Result>,
): Evaluated<Result> {
  const [asked, setAsked] = useState(gains);
  const { data, error, isFetching, isPlaceholderData } = useQuery({
    queryKey: ["evaluation", ...key, asked],
    queryFn: () => evaluate(asked ?? {}),
    enabled: asked !== null,
    placeholderData: keepPreviousData,
    gcTime: KEPT_MS,
    retry: false,
  });
  const isAsked = areSame(asked, gains);
  if (!isAsked && !isFetching) setAsked(gains);
  return {
    result: data ?? null,
    isCurrent: isAsked && data !== undefined && !isPlaceholderData,
    error: isAsked ? error : null,
  };
}

const KEPT_MS = 60_000;
/** The gate takes longer than a prediction, which is drawn first. */
const AT_REST_MS = 150;

export interface Evaluation {
  prediction: Evaluated<GainsPrediction>;
  gate: Evaluated<Gate>;
}

/** Why the gate refuses one of the gain sets, in a sentence; empty if it passes all, or while that is not known. */
export function useGateRefusal(campaignId: number, sets: readonly GainSet[]): string {
  const { data } = useQuery({
    queryKey: ["evaluation", "refusal", campaignId, sets],
    queryFn: async () => {
      const path = { campaign_id: campaignId };
      const gates = await Promise.all(sets.map((gains) => answer(evaluateGate({ path, body: { gains } }))));
      return gates.flatMap(({ checks }) => checks).find(({ passed }) => !passed)?.sentence ?? "";
    },
    enabled: sets.length > 0,
    gcTime: KEPT_MS,
    retry: false,
  });
  return data ?? "";
}

/** Evaluates the gains beside a proposal; nothing while there are none. */
export function useEvaluation(campaignId: number, proposalId: number, gains: GainSet | null): Evaluation {
  const [rested] = useDebouncedValue(gains, AT_REST_MS);
  const path = { campaign_id: campaignId };
  const prediction = useEvaluated(["prediction", campaignId, proposalId], gains, (some) =>
    answer(predictGains({ path, body: { gains: some } })),
  );
  const gate = useEvaluated(["gate", campaignId, proposalId], rested, (some) =>
    answer(evaluateGate({ path, body: { gains: some } })),
  );
  const isAtRest = areSame(rested, gains);
  return { prediction, gate: { ...gate, isCurrent: gate.isCurrent && isAtRest } };
}
