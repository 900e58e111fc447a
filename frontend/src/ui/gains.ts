import { gainText } from "./format";

/** A gain set as in the paper: `[400 20 100]`, in the experiment's order. */
export function gainsInBrackets(gains: Readonly<Record<string, number>>): string {
  return `[${Object.values(gains).map(gainText).join(" ")}]`;
}

type Gains = Readonly<Record<string, number>>;

/** The known gains, in the order of `names`. */
export function inOrder(gains: Gains, names: readonly string[]): Gains {
  return Object.fromEntries(names.flatMap((name) => (gains[name] === undefined ? [] : [[name, gains[name]]])));
}

/** Whether the held gains equal all safe gains. */
export function sameHeld(held: Gains, safe: Gains): boolean {
  const names = Object.keys(safe);
  return names.length > 0 && names.every((name) => held[name] === safe[name]);
}
