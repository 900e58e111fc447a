/** The library's styles are loaded component by component: one without its own would be seen only in the browser. */

import { existsSync, readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { expect, test } from "vitest";

const SOURCES = join(import.meta.dirname, "..");
const STYLES = join(SOURCES, "../node_modules/@mantine/core/styles");
const IMPORT = /import \{([^}]*)\} from "@mantine\/core"/g;

test("every component of the library that is used has its styles", () => {
  const used = readdirSync(SOURCES, { recursive: true, encoding: "utf8" })
    .filter((file) => file.endsWith(".tsx"))
    .flatMap((file) => [...readFileSync(join(SOURCES, file), "utf8").matchAll(IMPORT)])
    .flatMap(([, names = ""]) => names.split(",").map((name) => name.trim()));
  const loaded = readFileSync(join(SOURCES, "theme/mantine.css"), "utf8");
  const styled = [...new Set(used)].filter((name) => existsSync(join(STYLES, `${name}.css`)));
  expect(styled).toContain("Button");
  expect(styled.filter((name) => !loaded.includes(`/${name}.css"`))).toEqual([]);
});
