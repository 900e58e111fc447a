/** Work that may be asked for at any rate and is done no more often than the device can take. */

export interface Throttled {
  ask(): void;
  stop(): void;
}

/**
 * `work` runs at once when it is asked for, then again after a pause if it was asked for meanwhile, so the last asking
 * is always served. The pause is twice the time that the work took, at least `shortestMs`.
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

/** Once what has changed so far is on the screen: heavy work that waits for it does not keep an answer back. */
export async function afterPaint(): Promise<void> {
  if (document.visibilityState === "hidden") return; // where nothing is painted
  await new Promise<void>((done) => requestAnimationFrame(() => setTimeout(done)));
}
