import { gainText } from "./format";

/** A gain set as a table and the paper write it: `[400 20 100]`, in the experiment's order. */
export function gainsInBrackets(gains: Readonly<Record<string, number>>): string {
  return `[${Object.values(gains).map(gainText).join(" ")}]`;
}
