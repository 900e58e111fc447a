/** Unsaved notes, by flight: kept in this tab while other pages are open. */

const keyOf = (trialId: number): string => `note ${trialId}`;

/** The unsaved text of a flight's note, else the saved one. */
export function draftOf(trialId: number, saved: string): string {
  return sessionStorage.getItem(keyOf(trialId)) ?? saved;
}

export function keepDraft(trialId: number, text: string, saved: string): void {
  if (text === saved) sessionStorage.removeItem(keyOf(trialId));
  else sessionStorage.setItem(keyOf(trialId), text);
}

/** Forget the text that was saved, but not what has been typed since. */
export function forgetDraft(trialId: number, sent: string): void {
  if (sessionStorage.getItem(keyOf(trialId)) === sent) sessionStorage.removeItem(keyOf(trialId));
}
