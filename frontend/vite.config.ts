import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import react from "@vitejs/plugin-react";
import type { Plugin } from "vite";
import { defineConfig } from "vitest/config";

// `./dev npm run dev` serves the sources with hot reload and takes the API from a running `./dev up`.
const api = process.env["GAINLINE_URL"] ?? "http://127.0.0.1:8000";

/** Reports carry the chart library within themselves, as it is published and not as a module of the pages. */
const chartsForReports: Plugin = {
  name: "charts-for-reports",
  generateBundle() {
    const library = createRequire(import.meta.url).resolve("plotly.js-cartesian-dist-min");
    this.emitFile({ type: "asset", fileName: "report/plotly-cartesian.min.js", source: readFileSync(library) });
  },
};

const CHARTS = "plotly-basic";

/** Tells `early.js` where the chart library is. */
const chartsEarly: Plugin = {
  name: "charts-early",
  transformIndexHtml: {
    order: "post",
    handler: (html, { bundle }) => {
      const charts = Object.keys(bundle ?? {}).find((name) => name.startsWith(`assets/${CHARTS}`));
      return charts ? html.replace('src="/early.js"', `src="/early.js" data-charts="/${charts}"`) : html;
    },
  },
};

/** Drawing needs the most of the chart library: the browser compiles it whole and beside the page's own work. */
const compiledWhole = (chunk: { name: string }) =>
  chunk.name.startsWith(CHARTS) ? "//# allFunctionsCalledOnLoad" : "";

export default defineConfig({
  plugins: [react(), chartsForReports, chartsEarly],
  // The name that the browser asked for is passed on: the API refuses acts from pages of another origin.
  server: { host: "127.0.0.1", proxy: { "/api": { target: api, changeOrigin: false } } },
  css: { modules: { generateScopedName: "_[hash:base64:5]" } }, // short names for what is loaded
  build: {
    target: "es2023", // whose browsers need no polyfill for preloading
    modulePreload: { polyfill: false },
    sourcemap: false,
    rolldownOptions: { output: { postBanner: compiledWhole } },
  },
  // A document for each file, as ever, but not a process for each: making those took ten times as long as the tests.
  test: {
    environment: "jsdom",
    include: ["src/**/*.test.{ts,tsx}"],
    pool: "vmThreads",
    restoreMocks: true,
    testTimeout: 60_000, // a busy neighbour is no failure
  },
});
