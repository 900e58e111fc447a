/** Comparison of flights of any campaigns. Keys are below `campaigns`: a change of a flight invalidates both. */

import { keepPreviousData, useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import { compareFlights, getComparisonFigure } from "./generated";
import { type Theme, useFigure } from "./queries";

export type { ComparedFlight, FlightComparison, FlightDifference, FlightPair } from "./generated";

export function useComparison(trials: readonly number[]) {
  return useQuery({
    queryKey: ["campaigns", "compared", trials],
    queryFn: () => answer(compareFlights({ query: { trial: [...trials] } })),
    enabled: trials.length > 1,
    placeholderData: keepPreviousData,
  });
}

export function comparisonFigure(trials: readonly number[], theme: Theme) {
  return answer(getComparisonFigure({ query: { trial: [...trials], theme } }));
}

export function useComparisonFigure(trials: readonly number[]) {
  return useFigure(["campaigns", "compared", trials, "figure"], (theme) => comparisonFigure(trials, theme));
}

/** The flights in an address, of which the first is the reference, and the campaign whose flights are listed first. */
export function paramsOf(trials: readonly number[], campaign: number | string | null = null): URLSearchParams {
  const params = new URLSearchParams(campaign === null ? {} : { campaign: String(campaign) });
  for (const trial of trials) params.append("trial", String(trial));
  return params;
}

export const curvesCsv = (trials: readonly number[]): string => `/api/compare/curves.csv?${paramsOf(trials)}`;
