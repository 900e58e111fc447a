import { Text } from "@mantine/core";
import { useWindowEvent } from "@mantine/hooks";
import { IconPlaneDeparture } from "@tabler/icons-react";
import { type PointerEvent, useCallback, useEffect, useId, useRef, useState } from "react";
import classes from "./HoldButton.module.css";
import { Note } from "./Note";

interface Props {
  label: string;
  disabled?: boolean;
  onHeld: () => void;
}

const AROUND = 2 * Math.PI * 20;

/**
 * Calls `onHeld` after a press of two seconds; an earlier release cancels. Ignores the keyboard. A hold that ends early
 * says whether the finger or something else ended it.
 */
export function HoldButton({ label, disabled = false, onHeld }: Props) {
  const [share, setShare] = useState<number | null>(null);
  const [cancelled, setCancelled] = useState<"" | "Hold interrupted" | "Released early">("");
  const pointer = useRef<number | null>(null);
  const frame = useRef(0);
  const note = useId();
  const act = useRef(onHeld);
  act.current = onHeld;

  const letGo = useCallback((): void => {
    cancelAnimationFrame(frame.current);
    pointer.current = null;
    setShare(null);
  }, []);

  const interrupt = useCallback((): void => {
    if (pointer.current !== null) setCancelled("Hold interrupted");
    letGo();
  }, [letGo]);

  const watch = useCallback(
    (hold: Hold): void => {
      frame.current = requestAnimationFrame(() => {
        if (pointer.current === null) return;
        const now = holdProgress(hold, performance.now());
        if (now.kind === "holding") {
          setShare(now.share);
          watch(now.hold);
          return;
        }
        if (now.kind === "broken") return interrupt();
        letGo();
        act.current();
      });
    },
    [letGo, interrupt],
  );

  function press(event: PointerEvent<HTMLButtonElement>): void {
    if (disabled || event.button !== 0 || pointer.current !== null) return;
    // A finger that slides off the button counts as released.
    event.currentTarget.releasePointerCapture(event.pointerId);
    pointer.current = event.pointerId;
    const now = performance.now();
    setShare(0);
    setCancelled("");
    watch({ sinceMs: now, seenMs: now });
  }

  useWindowEvent("blur", interrupt);
  useWindowEvent("visibilitychange", interrupt);
  useEffect(() => () => cancelAnimationFrame(frame.current), []);

  useEffect(() => {
    if (disabled) interrupt();
  }, [disabled, interrupt]);

  const release = (event: PointerEvent<HTMLButtonElement>): void => {
    if (event.pointerId !== pointer.current) return;
    setCancelled("Released early");
    letGo();
  };
  const cancel = (event: PointerEvent<HTMLButtonElement>): void => {
    if (event.pointerId === pointer.current) interrupt();
  };
  return (
    <div>
      <button
        type="button"
        className={classes["hold"]}
        data-holding={share !== null || undefined}
        disabled={disabled}
        aria-describedby={note}
        onPointerDown={press}
        onPointerUp={release}
        onPointerCancel={cancel}
        onPointerLeave={release}
        onContextMenu={(event) => event.preventDefault()}
      >
        <svg viewBox="0 0 48 48" width={56} height={56} overflow="visible" aria-hidden>
          <circle cx={24} cy={24} r={20} fill="var(--real-stripe-a)" stroke="rgb(74 35 0 / 30%)" strokeWidth={5} />
          <circle
            cx={24}
            cy={24}
            r={20}
            fill="none"
            stroke="currentcolor"
            strokeWidth={5}
            transform="rotate(-90 24 24)"
            strokeDasharray={AROUND}
            strokeDashoffset={AROUND * (1 - (share ?? 0))}
          />
          <IconPlaneDeparture x={13} y={13} size={22} />
        </svg>
        <span>{share === null ? label : `Keep holding… ${(2 * (1 - share)).toFixed(1)} s`}</span>
      </button>
      {cancelled && (
        <Text role="status" mt={8} c="var(--bad)" fw={650}>
          {cancelled}: nothing was sent.{!disabled && " Hold again."}
        </Text>
      )}
      <Note id={note} mt={6} mx={2} fz="fine">
        Hold for 2 s with a finger or pointer; release to cancel.
      </Note>
    </div>
  );
}

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
