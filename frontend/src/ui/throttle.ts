/** Throttling of work to a rate that the device can keep up with. */

export interface Throttled {
  ask(): void;
  stop(): void;
}

/**
 * Run `work` immediately when requested, and again after a pause if it was requested in between: the last request is
 * always served. The pause is twice the duration of the work, at least `shortestMs`.
 */
export function throttled(work: () => Promise<unknown>, shortestMs: number): Throttled {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let busy = false;
  let asked = false;
  let stopped = false;

  async function run(): Promise<void> {
    busy = true;
    asked = false;
    const begun = performance.now();
    try {
      await work();
    } finally {
      timer = setTimeout(rest, Math.max(shortestMs, 2 * (performance.now() - begun)));
    }
  }

  function rest(): void {
    busy = false;
    if (asked && !stopped) void run();
  }

  return {
    ask() {
      asked = true;
      if (!busy && !stopped) void run();
    },
    stop() {
      stopped = true;
      clearTimeout(timer);
    },
  };
}

export const LONGEST_PAINT_MS = 500;

/**
 * Resolves after the next paint, so that heavy work does not delay the display of earlier changes. A browser that paints
 * nothing (a hidden tab, a covered window, a stalled compositor) delays it for half a second and no longer.
 */
export async function afterPaint(): Promise<void> {
  if (document.visibilityState === "hidden") return;
  await new Promise<void>((done) => {
    requestAnimationFrame(() => setTimeout(done));
    setTimeout(done, LONGEST_PAINT_MS);
  });
}
