/** Keyboard shortcuts: their help texts, and their commands in the frame. */

export interface Key {
  keys: readonly string[];
  does: string;
}

const EVERYWHERE: readonly Key[] = [
  { keys: ["Space"], does: "Abort the flight, on every page and even while typing." },
  { keys: ["Tab"], does: "Next control; with Shift, the previous one. The first control skips to the content." },
  { keys: ["Enter"], does: "Press the focused button, or follow the focused link." },
  { keys: ["Esc"], does: "Close the open menu or dialog." },
  { keys: ["?"], does: "Show these shortcuts." },
];

const JUMP: Key = { keys: ["j", "k"], does: "Next or previous flight." };

const OF_PAGES: readonly { page: RegExp; keys: readonly Key[] }[] = [
  { page: /^\/$/, keys: [{ keys: ["/"], does: "Focus the search field." }] },
  {
    page: /^\/campaigns\/\d+$/,
    keys: [
      JUMP,
      { keys: ["x"], does: "Select the shown flight for comparison, or deselect it." },
      { keys: ["c"], does: "Compare the selected flights." },
    ],
  },
  { page: /^\/campaigns\/\d+\/flights\//, keys: [JUMP] },
  {
    page: /^\/campaigns\/|^\/compare/,
    keys: [
      { keys: ["←", "→"], does: "Previous or next option, for example of the simulation speed." },
      { keys: ["Tab", "Enter"], does: "On a chart's table button: show the numbers as a table." },
    ],
  },
];

/** Shortcuts of the page at `path`, its own first. */
export function keysOf(path: string): Key[] {
  return [...OF_PAGES.filter(({ page }) => page.test(path)).flatMap(({ keys }) => keys), ...EVERYWHERE];
}

type Press = Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "altKey">;

export type Command = "help" | "search" | "next" | "previous" | "select" | "compare";

const COMMANDS: Readonly<Record<string, Command>> = {
  "?": "help",
  "/": "search",
  j: "next",
  k: "previous",
  x: "select",
  c: "compare",
};

/** Command of a key press; null while the user types. */
export function commandOf({ key, ctrlKey, metaKey, altKey }: Press, isTyping: boolean): Command | null {
  return isTyping || ctrlKey || metaKey || altKey ? null : (COMMANDS[key] ?? null);
}

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
