import { gainText } from "./format";

/** A gain set as a table and the paper write it: `[400 20 100]`, in the experiment's order. */
export function gainsInBrackets(gains: Readonly<Record<string, number>>): string {
  return `[${Object.values(gains).map(gainText).join(" ")}]`;
}

type Gains = Readonly<Record<string, number>>;

/** The gains in the order of `names`, those that are known. */
export function inOrder(gains: Gains, names: readonly string[]): Gains {
  return Object.fromEntries(names.flatMap((name) => (gains[name] === undefined ? [] : [[name, gains[name]]])));
}

/** Whether the vehicle holds all of the safe gains. */
export function sameHeld(held: Gains, safe: Gains): boolean {
  const names = Object.keys(safe);
  return names.length > 0 && names.every((name) => held[name] === safe[name]);
}
