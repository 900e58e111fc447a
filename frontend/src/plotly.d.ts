declare module "plotly.js-cartesian-dist-min" {
  interface Plotly {
    react(element: HTMLElement, data: unknown[], layout: Record<string, unknown>, config: unknown): Promise<unknown>;
    restyle(element: HTMLElement, change: Record<string, unknown>, traces: number[]): Promise<unknown>;
    purge(element: HTMLElement): void;
    Plots: { resize(element: HTMLElement): Promise<unknown> };
  }
  const plotly: Plotly;
  export default plotly;
}
