import type { FigureTable } from "../api/types";
import { gainText, NOTHING, trueMinus } from "./format";
import { ListTable } from "./ListTable";

function cell(value: string | number | null, digits: number | null): string {
  if (value === null) return NOTHING;
  if (typeof value === "string") return value;
  return digits === null ? gainText(value) : trueMinus(value.toFixed(digits));
}

type Row = FigureTable["rows"][number];

/** The data of a figure as a table. */
export function DataTable({ table, label, height }: { table: FigureTable; label: string; height: number }) {
  return (
    <ListTable
      label={label}
      height={height}
      rows={table.rows}
      keyOf={([first]) => String(first)}
      what="rows"
      columns={table.columns.map(({ name, title, unit, digits }, index) => ({
        id: name,
        title: unit ? `${title} (${unit})` : title,
        cell: (row: Row) => <span title={String(row[index] ?? "")}>{cell(row[index] ?? null, digits)}</span>,
      }))}
    />
  );
}
