/** The flight that is pointed at: its curve, its marks and its row stand out together, and no component is drawn anew. */

type Listener = (flight: number | null) => void;

const listeners = new Set<Listener>();
let pointed: number | null = null;

export function pointAt(flight: number | null): void {
  if (flight === pointed) return;
  pointed = flight;
  for (const listener of listeners) listener(flight);
}

/** Calls `listener` with each flight that is pointed at, null for none; returns what ends that. */
export function onPointed(listener: Listener): () => void {
  listeners.add(listener);
  return () => void listeners.delete(listener);
}
