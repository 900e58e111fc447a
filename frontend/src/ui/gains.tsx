import { Fragment } from "react";
import type { Vehicle } from "../api/types";
import { gainText, NOTHING } from "./format";
import { useGainTitles } from "./units";

interface Props {
  gains: Readonly<Record<string, number>>;
  experiment: string;
}

/** Gains in a line, to four digits; the title has the name and the full number. */
export function GainList({ gains, experiment }: Props) {
  const titles = useGainTitles(experiment);
  return (
    <span>
      {Object.entries(gains).map(([name, value], index) => (
        <Fragment key={name}>
          {index > 0 && " · "}
          <span style={{ whiteSpace: "nowrap" }} title={`${titles[name] ?? name}: ${value}`}>
            {name} {gainText(value)}
          </span>
        </Fragment>
      ))}
    </span>
  );
}

type Gains = Readonly<Record<string, number>>;

/** A gain set as in the paper: `[400 20 100]`, in the order of `names`, with a dash for an unknown gain. */
export function gainsInBrackets(gains: Gains, names: readonly string[] = Object.keys(gains)): string {
  return `[${names.map((name) => (gains[name] === undefined ? NOTHING : gainText(gains[name]))).join(" ")}]`;
}

/** The known gains, in the order of `names`. */
export function inOrder(gains: Gains, names: readonly string[]): Gains {
  return Object.fromEntries(names.flatMap((name) => (gains[name] === undefined ? [] : [[name, gains[name]]])));
}

/** Whether the held gains equal all safe gains. */
export function sameHeld(held: Gains, safe: Gains): boolean {
  const names = Object.keys(safe);
  return names.length > 0 && names.every((name) => held[name] === safe[name]);
}

export const RESTORED = "The safe gains are restored after every flight.";

/** When a vehicle that holds other gains is given its safe gains. */
export function safeGainsWritten({ state, identity }: Pick<Vehicle, "state" | "identity">): string {
  switch (state) {
    case "disconnected":
      return identity === null ? RESTORED : "The safe gains are written at the next connection.";
    case "ready":
      return "The safe gains are written at the next check, restore or flight.";
    case "quarantined":
      return "The safe gains are written when they are restored or the vehicle is released.";
    case "staged":
    case "flying":
      return RESTORED;
  }
}
