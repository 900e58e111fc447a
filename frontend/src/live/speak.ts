/** Speech output of the browser. */

import type { Sentence } from "./speech";

/** Speak after the current sentence, or at once if urgent. Does nothing without speech synthesis. */
export function speak({ text, urgent }: Sentence): void {
  if (!("speechSynthesis" in window)) return;
  if (urgent) window.speechSynthesis.cancel();
  const words = new SpeechSynthesisUtterance(text);
  words.lang = "en";
  window.speechSynthesis.speak(words);
}
