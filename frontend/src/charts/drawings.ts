/** The drawings of one chart. */

export type Enqueue = (draw: () => Promise<void>) => Promise<void>;

/**
 * Draw one after the other: of two animations that overlap, Plotly never settles the promise of the first. A drawing that
 * fails is told, and does not stop those after it.
 */
export function createDrawings(onError: (error: unknown) => void): Enqueue {
  let last = Promise.resolve();
  return (draw) => {
    last = last.then(draw).catch(onError);
    return last;
  };
}
