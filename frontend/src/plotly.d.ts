declare module "plotly.js-cartesian-dist-min" {
  interface Plotly {
    react(element: HTMLElement, data: unknown[], layout: Record<string, unknown>, config: unknown): Promise<unknown>;
    update(
      element: HTMLElement,
      data: Record<string, unknown>,
      layout: Record<string, unknown>,
      traces: number[],
    ): Promise<unknown>;
    purge(element: HTMLElement): void;
    Plots: { resize(element: HTMLElement): Promise<unknown> };
  }
  const plotly: Plotly;
  export default plotly;
}
