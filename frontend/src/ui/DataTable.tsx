import type { FigureTable } from "../api/types";
import { gainText, NOTHING, trueMinus } from "./format";
import { ListTable } from "./ListTable";

function cell(value: string | number | null, digits: number | null): string {
  if (value === null) return NOTHING;
  if (typeof value === "string") return value;
  return digits === null ? gainText(value) : trueMinus(value.toFixed(digits));
}

type Row = FigureTable["rows"][number];

interface Props {
  table: FigureTable;
  label: string;
  /** In px; without it as high as its rows, which are few and are stacked where the screen is narrow. */
  height?: number;
}

/** The data of a figure as a table. */
export function DataTable({ table, label, height }: Props) {
  return (
    <ListTable
      label={label}
      {...(height === undefined ? { stacks: true } : { height })}
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
