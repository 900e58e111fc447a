import { useEffect } from "react";
import { type Command, commandOf } from "./keys";

function isTyping(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.matches("input, textarea, select, [contenteditable]");
}

/** Carry out a command when its key is pressed, unless the user types; the key then has no other effect. */
export function useKeys(acts: Partial<Record<Command, () => void>>): void {
  useEffect(() => {
    function onKey(event: KeyboardEvent): void {
      const command = commandOf(event, isTyping(event.target));
      const act = command === null ? undefined : acts[command];
      if (act === undefined) return;
      event.preventDefault();
      act();
    }
    document.addEventListener("keydown", onKey);
    return () => document.removeEventListener("keydown", onKey);
  });
}
