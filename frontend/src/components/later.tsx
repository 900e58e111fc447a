import { Component, type ComponentType, lazy, type ReactNode } from "react";
import { ApiError, PAGE_MISSING } from "../lib/problems";
import type * as Later from "../pages/later";
import { PageUnavailable } from "./PageUnavailable";
import { loadPlotly } from "./plotly";

type Pages = typeof Later;

async function fetchLater(): Promise<Pages> {
  try {
    return await import("../pages/later");
  } catch {
    throw new ApiError(PAGE_MISSING);
  }
}

/** A page whose code comes after the first page's. */
export function later(name: keyof Pages): ComponentType {
  return lazy(async () => ({ default: (await fetchLater())[name] }));
}

const SOON_MS = 2500;

/** Fetch the code of every page and of the charts, so that none is missing once the server or the Wi-Fi is lost. */
export function fetchEveryPage(): void {
  // What cannot be had now is asked for again by the page that needs it, which then says what is wrong.
  setTimeout(() => void Promise.allSettled([fetchLater(), loadPlotly(), loadPlotly("contours")]), SOON_MS);
}

interface GuardProps {
  /** Another page is another try. */
  path: string;
  children: ReactNode;
}

interface GuardState {
  error: unknown;
}

/** Says so when a page's code cannot be had or the page breaks: never an empty screen. */
export class PageGuard extends Component<GuardProps, GuardState> {
  override state: GuardState = { error: null };

  static getDerivedStateFromError(error: unknown): GuardState {
    return { error };
  }

  override componentDidUpdate({ path }: GuardProps): void {
    if (path !== this.props.path && this.state.error !== null) this.setState({ error: null });
  }

  override render(): ReactNode {
    return this.state.error === null ? this.props.children : <PageUnavailable error={this.state.error} />;
  }
}
