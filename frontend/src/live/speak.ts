/** The browser's voice. */

import type { Sentence } from "./speech";

/** Says it after what is being said, or at once. Silent in a browser without a voice. */
export function speak({ text, urgent }: Sentence): void {
  if (!("speechSynthesis" in window)) return;
  if (urgent) window.speechSynthesis.cancel();
  const words = new SpeechSynthesisUtterance(text);
  words.lang = "en";
  window.speechSynthesis.speak(words);
}
