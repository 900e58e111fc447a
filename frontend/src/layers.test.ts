/** Folders stand in layers: a file imports from its own folder and from those before it. */

import { readdirSync, readFileSync } from "node:fs";
import { dirname, join, relative } from "node:path";
import { expect, test } from "vitest";

const LAYERS = [
  "theme",
  "api",
  "live",
  "ui",
  "charts",
  "frame",
  "features/jobs",
  "features/fleet",
  "features/log-analysis",
  "features/new-campaign",
  "features/settings",
  "features/campaign",
  "features/campaign-list",
  "features/compare",
  "features/fly",
  "pages",
  "app",
  "main",
];

const ROOT = import.meta.dirname;
const IMPORT = /(?:from|import)\s*\(?\s*"(\.[^"]*)"/g;

function layerOf(file: string): string {
  return LAYERS.find((layer) => file === layer || file.startsWith(`${layer}/`) || file.startsWith(`${layer}.`)) ?? "";
}

function* imports(): Generator<{ file: string; imported: string }> {
  for (const entry of readdirSync(ROOT, { recursive: true, withFileTypes: true })) {
    if (!entry.isFile() || !/\.tsx?$/.test(entry.name)) continue;
    const path = join(entry.parentPath, entry.name);
    for (const [, specifier = ""] of readFileSync(path, "utf8").matchAll(IMPORT)) {
      yield { file: relative(ROOT, path), imported: relative(ROOT, join(dirname(path), specifier)) };
    }
  }
}

test("no file imports from a layer above its own", () => {
  const upward = [...imports()].filter(
    ({ file, imported }) => LAYERS.indexOf(layerOf(imported)) > LAYERS.indexOf(layerOf(file)),
  );
  expect(upward.filter(({ file }) => file !== "layers.test.ts")).toEqual([]);
});

test("every file has its layer", () => {
  const files = new Set([...imports()].map(({ file }) => file));
  expect([...files].filter((file) => layerOf(file) === "" && !file.startsWith("layers"))).toEqual([]);
});
