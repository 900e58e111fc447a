import type { FigureTable } from "../api/types";
import { gainText, NOTHING, trueMinus } from "./format";
import { useLastRows } from "./paging";
import classes from "./ScrollTable.module.css";

function cell(value: string | number | null, digits: number | null): string {
  if (value === null) return NOTHING;
  if (typeof value === "string") return value;
  return digits === null ? gainText(value) : trueMinus(value.toFixed(digits));
}

/** The data of a figure as a table. */
export function DataTable({ table, label, height }: { table: FigureTable; label: string; height: number }) {
  const { more, listed } = useLastRows(table.rows, table.columns.length, "rows", () => false);
  return (
    // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
    <section className={`${classes["scroll"]} sideways`} style={{ height }} aria-label={label} tabIndex={0}>
      <table className={`${classes["table"]} ${classes["numeric"]}`}>
        <thead>
          <tr>
            {table.columns.map((column) => (
              <th key={column.name} scope="col">
                {column.title}
                {column.unit && <small> ({column.unit})</small>}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {more}
          {listed.map((row) => (
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
