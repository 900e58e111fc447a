/** Protection against accidental touches: a button held for two seconds, and a slider dragged to its end. */

const HOLD_MS = 2000;
/** A page that hung for longer cannot tell whether the finger stayed down. */
const BLIND_MS = 1000;

export interface Hold {
  sinceMs: number;
  seenMs: number;
}

export type Held = { kind: "holding"; share: number; hold: Hold } | { kind: "done" } | { kind: "broken" };

/** State of a hold at `nowMs`. */
export function holdProgress({ sinceMs, seenMs }: Hold, nowMs: number): Held {
  if (nowMs - seenMs > BLIND_MS) return { kind: "broken" };
  if (nowMs - sinceMs >= HOLD_MS) return { kind: "done" };
  return { kind: "holding", share: (nowMs - sinceMs) / HOLD_MS, hold: { sinceMs, seenMs: nowMs } };
}

const ARRIVED = 0.97;

/** Position of the knob along its track, 0 to 1, after a drag from `fromPx` to `toPx`. */
export function slideShare(fromPx: number, toPx: number, travelPx: number): number {
  if (travelPx <= 0) return 0;
  return Math.min(1, Math.max(0, (toPx - fromPx) / travelPx));
}

export function hasArrived(share: number): boolean {
  return share >= ARRIVED;
}
