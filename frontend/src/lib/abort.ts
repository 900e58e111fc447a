/** Who the Space key aborts, and when it must not. */

export interface Flying {
  campaignId: number;
  trialId: number;
}

/** The flight on the page that one looks at; when it shows none, everything in the air. */
export function abortTargets(flying: readonly Flying[], campaignOnPage: number | null): Flying[] {
  const here = flying.filter((flight) => flight.campaignId === campaignOnPage);
  return here.length > 0 ? here : [...flying];
}

const TEXT_INPUTS = new Set(["text", "search", "number", "email", "url", "tel", "password"]);

/** Whether a key press belongs to somebody who is writing. */
export function isWriting(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLTextAreaElement || target.isContentEditable) return true;
  return target instanceof HTMLInputElement && TEXT_INPUTS.has(target.type);
}
