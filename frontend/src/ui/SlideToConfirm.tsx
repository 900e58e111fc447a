import { IconChevronsRight } from "@tabler/icons-react";
import { type PointerEvent, useId, useRef, useState } from "react";
import { hasArrived, slideShare } from "./HoldButton";
import classes from "./SlideToConfirm.module.css";

interface Props {
  label: string;
  /** Consequence, read out by screen readers with the label. */
  meaning: string;
  disabled?: boolean;
  onConfirm: () => void;
}

interface Drag {
  pointer: number;
  fromPx: number;
  travelPx: number;
}

/** Calls `onConfirm` when the knob is dragged along the whole track. Ignores taps and the keyboard. */
export function SlideToConfirm({ label, meaning, disabled = false, onConfirm }: Props) {
  const [share, setShare] = useState(0);
  const track = useRef<HTMLDivElement>(null);
  const drag = useRef<Drag | null>(null);
  const note = useId();

  function take(event: PointerEvent<HTMLButtonElement>): void {
    if (disabled || event.button !== 0 || drag.current !== null) return;
    const knob = event.currentTarget;
    knob.setPointerCapture(event.pointerId);
    const travelPx = (track.current?.clientWidth ?? 0) - knob.offsetWidth;
    drag.current = { pointer: event.pointerId, fromPx: event.clientX, travelPx };
  }

  function move(event: PointerEvent<HTMLButtonElement>): void {
    const { current } = drag;
    if (current === null || current.pointer !== event.pointerId || disabled) return;
    const reached = slideShare(current.fromPx, event.clientX, current.travelPx);
    setShare(reached);
    if (!hasArrived(reached)) return;
    letGo();
    onConfirm();
  }

  function letGo(): void {
    drag.current = null;
    setShare(0);
  }

  return (
    <div ref={track} className={classes["track"]} data-disabled={disabled || undefined}>
      <button
        type="button"
        className={classes["knob"]}
        style={{ left: `calc(${share} * (100% - var(--knob)))` }}
        disabled={disabled}
        aria-label={label}
        aria-describedby={note}
        onPointerDown={take}
        onPointerMove={move}
        onPointerUp={letGo}
        onPointerCancel={letGo}
        onContextMenu={(event) => event.preventDefault()}
      >
        <IconChevronsRight size={26} aria-hidden />
      </button>
      <span className={classes["label"]} aria-hidden>
        {label}
      </span>
      <span id={note} className="visually-hidden">
        {meaning} Slide to the end with a finger or pointer. The keyboard is ignored.
      </span>
    </div>
  );
}
