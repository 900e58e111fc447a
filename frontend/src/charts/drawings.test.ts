import { expect, test, vi } from "vitest";
import { createDrawings, moveCurves } from "./drawings";

/** As Plotly's `animate`: one that begins before the last has ended leaves the promise of that one pending for ever. */
function animator() {
  const drawn: string[] = [];
  let settle: (() => void) | null = null;
  const animate = (what: string): Promise<void> => {
    drawn.push(what);
    return new Promise((done) => {
      settle = done;
      setTimeout(() => settle === done && done());
    });
  };
  return { drawn, animate };
}

test("animations of a prediction and of a live curve do not overlap, so that the chart is drawn again after them", async () => {
  const { drawn, animate } = animator();
  const enqueue = createDrawings(() => undefined);
  void enqueue(() => animate("prediction"));
  void enqueue(() => animate("live"));
  await enqueue(() => animate("figure"));
  expect(drawn).toEqual(["prediction", "live", "figure"]);
});

test("a drawing that fails is told and does not stop those after it", async () => {
  const told: unknown[] = [];
  const enqueue = createDrawings((error) => told.push(error));
  const drawn: string[] = [];
  void enqueue(() => Promise.reject(new Error("no room")));
  await enqueue(async () => void drawn.push("figure"));
  expect(told).toEqual([new Error("no room")]);
  expect(drawn).toEqual(["figure"]);
});

test("curves are drawn within half a second by a browser that paints nothing", async () => {
  vi.useFakeTimers();
  const animate = vi.fn((_chart: unknown, frames: unknown) =>
    Array.isArray(frames) ? Promise.resolve() : new Promise<void>(() => undefined),
  );
  const update = vi.fn(() => Promise.resolve());
  const moved = moveCurves({ animate, update } as never, {} as HTMLElement, [{ x: [0, 1], y: [3, 4] }], [2]);
  await vi.advanceTimersByTimeAsync(499);
  expect(update).not.toHaveBeenCalled();
  await vi.advanceTimersByTimeAsync(1);
  await moved;
  expect(update).toHaveBeenCalledWith({}, { x: [[0, 1]], y: [[3, 4]] }, {}, [2]);
  vi.useRealTimers();
});
