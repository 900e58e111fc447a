import { expect, test } from "vitest";
import { fileNameIn } from "./files";

test("a file is saved under the name that the server gives it", () => {
  expect(fileNameIn('attachment; filename="gainline-2026-11-22T0600Z.sqlite3"')).toBe(
    "gainline-2026-11-22T0600Z.sqlite3",
  );
  expect(fileNameIn("attachment; filename*=utf-8''Nr.%201%20%E2%80%93%20Halle.zip")).toBe("Nr. 1 – Halle.zip");
  expect(fileNameIn(null)).toBe("");
});
