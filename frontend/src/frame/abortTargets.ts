/** Whom the Space key aborts. */

export interface Flying {
  campaignId: number;
  trialId: number;
}

/** The flight on the page that one looks at; when it shows none, everything in the air. */
export function abortTargets(flying: readonly Flying[], campaignOnPage: number | null): Flying[] {
  const here = flying.filter((flight) => flight.campaignId === campaignOnPage);
  return here.length > 0 ? here : [...flying];
}
