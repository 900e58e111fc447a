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

/** A page whose code comes after the first page's. */
export function lazyPage(name: keyof Pages): ComponentType {
  return lazy(async () => ({ default: (await fetchPages())[name] }));
}

const SOON_MS = 2500;

/** Fetch the code of every page and of the charts, so that none is missing once the server or the Wi-Fi is lost. */
export function fetchEveryPage(): void {
  // What cannot be had now is asked for again by the page that needs it, which then says what is wrong.
  setTimeout(() => void Promise.allSettled([fetchPages(), loadPlotly(), loadPlotly("contours")]), SOON_MS);
}
