/** Flights that the Space key aborts. */

export interface Flying {
  campaignId: number;
  trialId: number;
}

/** The flight of the open page; if it has none, all flights. */
export function abortTargets(flying: readonly Flying[], campaignOnPage: number | null): Flying[] {
  const here = flying.filter((flight) => flight.campaignId === campaignOnPage);
  return here.length > 0 ? here : [...flying];
}
