import { MantineProvider } from "@mantine/core";
import { act } from "react";
import { createRoot } from "react-dom/client";
import { expect, test, vi } from "vitest";
import { type Column, ListTable } from "./ListTable";

interface Flight {
  number: number;
  error: number | null;
}

const COLUMNS: Column<Flight>[] = [
  { title: "Flight", cell: ({ number }) => number },
  { title: "Error", value: ({ error }) => error, cell: ({ error }) => error },
];

/** The table in a page: what is in its rows, and a click on a button of it. */
async function opened(rows: readonly Flight[], isKept?: (row: Flight) => boolean) {
  vi.stubGlobal("IS_REACT_ACT_ENVIRONMENT", true);
  const page = document.createElement("div");
  const root = createRoot(page);
  const show = (columns: Column<Flight>[]) =>
    act(() =>
      root.render(
        <MantineProvider defaultColorScheme="light">
          <ListTable
            label="Flights"
            columns={columns}
            rows={rows}
            keyOf={({ number }) => String(number)}
            what="flights"
            isKept={isKept}
          />
        </MantineProvider>,
      ),
    );
  await show(COLUMNS);
  return {
    show,
    shown: () => [...page.querySelectorAll("tbody tr > :first-child")].map(({ textContent }) => textContent),
    order: () => page.querySelector("thead th:last-child")?.getAttribute("aria-sort"),
    press: (text: string) =>
      act(() => [...page.querySelectorAll("button")].find(({ textContent }) => textContent.startsWith(text))?.click()),
  };
}

test("a title sorts rising, then falling, then not; equal rows keep their order, those without a value come last", async () => {
  const errors = [0.3, null, 0.1, 0.3];
  const { shown, order, press } = await opened(errors.map((error, index) => ({ number: index + 1, error })));
  await press("Error");
  expect([order(), shown()]).toEqual(["ascending", ["3", "1", "4", "2"]]);
  await press("Error");
  expect([order(), shown()]).toEqual(["descending", ["1", "4", "3", "2"]]);
  await press("Error");
  expect([order(), shown()]).toEqual([null, ["1", "2", "3", "4"]]);
});

test("a long table shows its last rows, when sorted its first ones, and those that matter; more on request", async () => {
  const rows = Array.from({ length: 252 }, (_, index) => ({ number: index + 1, error: index }));
  const { shown, press } = await opened(rows, ({ number }) => number === 7 || number === 202);
  expect([shown()[0], shown().slice(1, 4), shown().length]).toEqual([
    "Show 200 earlier flights (202 hidden)",
    ["7", "202", "203"],
    53,
  ]);
  await press("Error");
  expect(shown().slice(-4)).toEqual(["49", "50", "202", "Show 200 further flights (202 hidden)"]);
  await press("Show 200");
  expect(shown().slice(-3)).toEqual(["249", "250", "Show 2 further flights (2 hidden)"]);
});

test("without the column that it was sorted by, a table is not sorted, and shows its last rows", async () => {
  const rows = Array.from({ length: 60 }, (_, index) => ({ number: index + 1, error: index }));
  const { show, shown, press } = await opened(rows);
  await press("Error");
  await show(COLUMNS.slice(0, 1));
  expect([shown()[0], shown().at(-1)]).toEqual(["Show 10 earlier flights (10 hidden)", "60"]);
});
