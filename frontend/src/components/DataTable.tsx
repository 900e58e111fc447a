import { Button } from "@mantine/core";
import { useState } from "react";
import type { FigureTable } from "../api/types";
import { gainText, NOTHING } from "../lib/format";
import { lastRows, MORE_ROWS, ROWS } from "../lib/rows";
import classes from "./DataTable.module.css";

function cell(value: string | number | null, digits: number | null): string {
  if (value === null) return NOTHING;
  if (typeof value === "string") return value;
  return digits === null ? gainText(value) : value.toFixed(digits);
}

/** A figure's data in numbers. */
export function DataTable({ table, label, height }: { table: FigureTable; label: string; height: number }) {
  const [count, setCount] = useState(ROWS);
  const hidden = Math.max(0, table.rows.length - count);
  return (
    // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
    <section className={`${classes["scroll"]} sideways`} style={{ height }} aria-label={label} tabIndex={0}>
      <table className={classes["table"]}>
        <thead>
          <tr>
            {table.columns.map((column) => (
              <th key={column.name} scope="col">
                {column.title}
                {column.unit && <span className={classes["unit"]}> ({column.unit})</span>}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {hidden > 0 && (
            <tr>
              <td colSpan={table.columns.length}>
                <Button variant="default" onClick={() => setCount(count + MORE_ROWS)}>
                  Show {Math.min(MORE_ROWS, hidden)} earlier rows ({hidden} are not listed)
                </Button>
              </td>
            </tr>
          )}
          {lastRows(table.rows, count, () => false).map((row) => (
            <tr key={String(row[0])}>
              {table.columns.map((column, index) => (
                <td key={column.name} title={String(row[index] ?? "")}>
                  {cell(row[index] ?? null, column.digits)}
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}
