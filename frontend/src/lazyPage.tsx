import { type ComponentType, lazy } from "react";
import { ApiError, PAGE_MISSING } from "./api/problems";
import { loadPlotly } from "./charts/plotly";
import type * as PageModule from "./pages";

type Pages = typeof PageModule;

async function fetchPages(): Promise<Pages> {
  try {
    return await import("./pages");
  } catch {
    throw new ApiError(PAGE_MISSING);
  }
}

/** A page whose code is loaded on demand. */
export function lazyPage(name: keyof Pages): ComponentType {
  return lazy(async () => ({ default: (await fetchPages())[name] }));
}

const SOON_MS = 2500;

/** Preload the code of all pages and charts, so that they still open when the server or the Wi-Fi is lost. */
export function fetchEveryPage(): void {
  // A page whose preload failed loads its code again when it is opened, and reports the error.
  setTimeout(() => void Promise.allSettled([fetchPages(), loadPlotly(), loadPlotly("contours")]), SOON_MS);
}
