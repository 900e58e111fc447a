declare module "plotly.js-basic-dist-min" {
  export interface Plotly {
    react(element: HTMLElement, data: unknown[], layout: Record<string, unknown>, config: unknown): Promise<unknown>;
    update(
      element: HTMLElement,
      data: Record<string, unknown>,
      layout: Record<string, unknown>,
      traces: number[],
    ): Promise<unknown>;
    animate(
      element: HTMLElement,
      frame: { data: Record<string, unknown>[]; traces: number[] } | readonly never[],
      options: Record<string, unknown>,
    ): Promise<unknown>;
    downloadImage(figure: unknown, options: Record<string, unknown>): Promise<string>;
    purge(element: HTMLElement): void;
    Fx: {
      hover(element: HTMLElement, points: { curveNumber: number; pointNumber: number }[], subplots?: string[]): void;
      unhover(element: HTMLElement): void;
    };
    Plots: { resize(element: HTMLElement): Promise<unknown> };
  }
  const plotly: Plotly;
  export default plotly;
}

declare module "plotly.js-cartesian-dist-min" {
  export { default } from "plotly.js-basic-dist-min";
}
