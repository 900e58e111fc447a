import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { afterPaint, throttled } from "./throttle";

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

test("many askings are served twice: at once, and once more for the last", async () => {
  let runs = 0;
  const drawing = throttled(async () => {
    runs += 1;
  }, 100);
  for (let asking = 0; asking < 20; asking += 1) drawing.ask();
  expect(runs).toBe(1);
  await vi.advanceTimersByTimeAsync(500);
  expect(runs).toBe(2);
  await vi.advanceTimersByTimeAsync(500);
  expect(runs).toBe(2);
});

test("a browser that paints nothing delays work by half a second", async () => {
  vi.stubGlobal("requestAnimationFrame", () => 0);
  const drawn = vi.fn();
  void afterPaint().then(drawn);
  await vi.advanceTimersByTimeAsync(499);
  expect(drawn).not.toHaveBeenCalled();
  await vi.advanceTimersByTimeAsync(1);
  expect(drawn).toHaveBeenCalledOnce();
  vi.unstubAllGlobals();
});

test("nothing runs after it was stopped", async () => {
  let runs = 0;
  const drawing = throttled(async () => {
    runs += 1;
  }, 100);
  drawing.ask();
  drawing.ask();
  drawing.stop();
  drawing.ask();
  await vi.advanceTimersByTimeAsync(500);
  expect(runs).toBe(1);
});
