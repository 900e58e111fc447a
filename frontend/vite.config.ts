import react from "@vitejs/plugin-react";
import { defineConfig } from "vitest/config";

// `./dev npm run dev` serves the sources with hot reload and takes the API from a running `./dev up`.
const api = process.env["GAINLINE_URL"] ?? "http://127.0.0.1:8000";

export default defineConfig({
  plugins: [react()],
  // The name that the browser asked for is passed on: the API refuses acts from pages of another origin.
  server: { host: "127.0.0.1", proxy: { "/api": { target: api, changeOrigin: false } } },
  build: { target: "es2023", sourcemap: false },
  test: { environment: "jsdom", include: ["src/**/*.test.{ts,tsx}"], restoreMocks: true },
});
