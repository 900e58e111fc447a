/** The hovered flight: its curve, markers and row are highlighted together, without rendering components. */

type Listener = (flight: number | null) => void;

const listeners = new Set<Listener>();
let pointed: number | null = null;

export function pointAt(flight: number | null): void {
  if (flight === pointed) return;
  pointed = flight;
  for (const listener of listeners) listener(flight);
}

/** Call `listener` with each hovered flight, null for none; returns the unsubscribe function. */
export function onPointed(listener: Listener): () => void {
  listeners.add(listener);
  return () => void listeners.delete(listener);
}
