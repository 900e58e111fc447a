/** What keys do, as the keyboard help tells it and as the frame obeys. */

export interface Key {
  keys: readonly string[];
  does: string;
}

const EVERYWHERE: readonly Key[] = [
  { keys: ["Space"], does: "While something flies: abort it, wherever you are, also from within a text." },
  { keys: ["Tab"], does: "To the next control; with Shift back. The first one of a page skips to its content." },
  { keys: ["Enter"], does: "Press the marked button, or follow the marked link." },
  { keys: ["Esc"], does: "Close what has opened." },
  { keys: ["?"], does: "This help." },
];

const OF_PAGES: readonly { page: RegExp; keys: readonly Key[] }[] = [
  { page: /^\/$/, keys: [{ keys: ["/"], does: "To the search." }] },
  {
    page: /^\/campaigns\/|^\/compare/,
    keys: [
      { keys: ["←", "→"], does: "In a row of choices, as the speed of a simulation: the one before or after." },
      { keys: ["Tab", "Enter"], does: "On “Table” at a chart: its numbers as a table instead." },
    ],
  },
];

/** What keys do on the page at `path`: its own first. */
export function keysOf(path: string): Key[] {
  return [...OF_PAGES.filter(({ page }) => page.test(path)).flatMap(({ keys }) => keys), ...EVERYWHERE];
}

type Press = Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "altKey">;

const COMMANDS: Readonly<Record<string, "help" | "search">> = { "?": "help", "/": "search" };

/** What a key asks for; nothing while one types. */
export function commandOf({ key, ctrlKey, metaKey, altKey }: Press, isTyping: boolean): "help" | "search" | null {
  return isTyping || ctrlKey || metaKey || altKey ? null : (COMMANDS[key] ?? null);
}
