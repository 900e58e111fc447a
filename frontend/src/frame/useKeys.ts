import { useWindowEvent } from "@mantine/hooks";
import { type Command, commandOf } from "./keys";

function isTyping(target: EventTarget | null): boolean {
  return (
    target instanceof HTMLElement &&
    target.matches("input:not([type=checkbox], [type=radio]), textarea, select, [contenteditable]")
  );
}

/** Carry out a command when its key is pressed, unless the user types. The key then has no other effect, but for an act
 * that returns false because there was nothing to do. */
export function useKeys(acts: Partial<Record<Command, () => unknown>>): void {
  useWindowEvent("keydown", (event) => {
    const command = commandOf(event, isTyping(event.target));
    const act = command === null ? undefined : acts[command];
    if (act !== undefined && act() !== false) event.preventDefault();
  });
}
