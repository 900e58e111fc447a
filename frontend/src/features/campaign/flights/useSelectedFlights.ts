import { useCallback, useState } from "react";
import { navigate } from "wouter/use-browser-location";
import { paramsOf } from "../../../api/compare";
import type { Trial } from "../../../api/types";
import { useKeys } from "../../../frame/useKeys";
import { wasFlown } from "../../../ui/states";
import { toggled } from "../../../ui/toggled";

export interface SelectedFlights {
  selected: readonly number[];
  onSelect: (trialId: number) => void;
}

/** The flights of a campaign that are selected for comparison, and the keys that select the shown one and compare. */
export function useSelectedFlights(campaignId: number, shown: Trial | null): SelectedFlights {
  const [selected, setSelected] = useState<readonly number[]>([]);
  const onSelect = useCallback((trialId: number) => setSelected((before) => toggled(before, trialId)), []);
  useKeys({
    select: () => shown !== null && wasFlown(shown.state) && onSelect(shown.id),
    compare: () => navigate(comparisonAddress(campaignId, selected)),
  });
  return { selected, onSelect };
}

/** Address of the comparison of these flights, in the order of selection. */
export function comparisonAddress(campaignId: number, trialIds: readonly number[]): string {
  return `/compare?${paramsOf(trialIds, campaignId)}`;
}
