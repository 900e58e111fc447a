import { Button, UnstyledButton } from "@mantine/core";
import { IconArrowDown, IconArrowUp } from "@tabler/icons-react";
import {
  createSortedRowModel,
  type RowData,
  rowSortingFeature,
  sortFn_basic,
  tableFeatures,
  useTable,
} from "@tanstack/react-table";
import { type ComponentProps, type ReactNode, useState } from "react";
import type { Topic } from "./explanations";
import { HelpTip } from "./HelpTip";
import classes from "./ListTable.module.css";

export interface Column<Row> {
  title: string;
  /** What it is known by, if not by its title. */
  id?: string;
  /** Below the title. */
  detail?: string;
  topic?: Topic;
  /** For cells that speak for themselves, such as those with buttons. */
  hidesTitle?: boolean;
  /** Its cells are the headings of their rows. */
  isHeading?: boolean;
  /** Aligned to the left, unlike numbers. */
  isText?: boolean;
  className?: string;
  /** What it sorts by; rows without a value come last, both ways. */
  value?: (row: Row) => number | string | null;
  cell: (row: Row) => ReactNode;
}

interface RowProps<Row> {
  columns: readonly Column<Row>[];
  /** Attributes of a row. */
  marks?: (row: Row) => Readonly<Record<`data-${string}`, string | number | boolean | undefined>>;
  /** A second line of a row, across all columns. */
  below?: (row: Row) => ReactNode;
  /** Whether, where the screen is too narrow, the cells of a row stand below each other, each beside its title. */
  stacks?: boolean;
}

interface Props<Row> extends RowProps<Row>, ComponentProps<"section"> {
  label: string;
  /** Whether a long table scrolls under its head instead of making the page longer. */
  framed?: boolean;
  /** In px, in place of what its rows need. */
  height?: number;
  rows: readonly Row[];
  keyOf: (row: Row) => string;
  /** What the rows of a table are that may be long: it shows the last ones, when sorted the first, more on request. */
  what?: string;
  /** Rows that are shown in any case. */
  isKept?: (row: Row) => boolean;
  /** Rows of a group stand below its name. */
  groupOf?: (row: Row) => string;
}

const FEATURES = tableFeatures({ rowSortingFeature, sortedRowModel: createSortedRowModel() });
const ROWS = 50;
const MORE_ROWS = 200;

/** A list as a table, in a region that scrolls sideways where the screen is too narrow; columns with values sort it. */
export function ListTable<Row extends RowData>({
  columns,
  marks,
  below,
  stacks = false,
  rows,
  keyOf,
  what,
  isKept,
  groupOf,
  label,
  framed = false,
  height,
  className = "",
  ...region
}: Props<Row>) {
  const [count, setCount] = useState(ROWS);
  const table = useTable({
    features: FEATURES,
    data: rows,
    enableMultiSort: false,
    columns: columns.map(({ title, id = title, value }) => ({
      id,
      accessorFn: (row: Row) => value?.(row) ?? undefined,
      sortFn: sortFn_basic,
      sortDescFirst: false,
      sortUndefined: "last" as const,
    })),
  });
  const isSorted = table.getAllLeafColumns().some((column) => column.getIsSorted());
  const all = table.getRowModel().rows.map(({ original }) => original);
  const hidden = what === undefined ? 0 : Math.max(0, all.length - count);
  const shown = all.filter((row, place) => (isSorted ? place < all.length - hidden : place >= hidden) || isKept?.(row));
  const bodyOf = groupOf ?? (below === undefined ? () => "" : keyOf);
  const more = hidden > 0 && (
    <tbody>
      <tr>
        <td colSpan={columns.length}>
          <Button variant="default" onClick={() => setCount(count + MORE_ROWS)}>
            Show {Math.min(MORE_ROWS, hidden)} {isSorted ? "further" : "earlier"} {what} ({hidden} hidden)
          </Button>
        </td>
      </tr>
    </tbody>
  );
  return (
    <section
      {...region}
      className={`${classes["scroll"]} ${framed || height !== undefined ? classes["framed"] : ""} sideways`}
      style={{ height, maxHeight: height }}
      aria-label={label}
      // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
      tabIndex={0}
    >
      <table className={`${classes["list"]} ${className}`} data-stacks={stacks || undefined}>
        <thead>
          <tr>
            {columns.map((column) => {
              const { title, id = title, value } = column;
              const by = value && table.getColumn(id);
              return (
                <Title key={id} column={column} sorted={by?.getIsSorted()} onSort={by && (() => by.toggleSorting())} />
              );
            })}
          </tr>
        </thead>
        {!isSorted && more}
        {[...new Set(shown.map(bodyOf))].map((name) => (
          <tbody key={name}>
            {groupOf && (
              <tr>
                <th scope="rowgroup" colSpan={columns.length} className={classes["group"]}>
                  {name}
                </th>
              </tr>
            )}
            {shown
              .filter((row) => bodyOf(row) === name)
              .map((row) => (
                <Lines key={keyOf(row)} {...{ row, columns, marks, below, stacks }} />
              ))}
          </tbody>
        ))}
        {isSorted && more}
      </table>
    </section>
  );
}

const ORDERS = { asc: "ascending", desc: "descending" } as const;

interface TitleProps<Row> {
  column: Column<Row>;
  sorted: "asc" | "desc" | false | undefined;
  onSort: (() => void) | undefined;
}

function Title<Row>({ column, sorted, onSort }: TitleProps<Row>) {
  const { title, detail, topic, hidesTitle } = column;
  const Icon = sorted === "desc" ? IconArrowDown : IconArrowUp;
  return (
    <th scope="col" className={classOf(column)} aria-sort={sorted ? ORDERS[sorted] : undefined}>
      <span className={hidesTitle ? "visually-hidden" : onSort && classes["title"]}>
        {onSort === undefined ? (
          title
        ) : (
          <UnstyledButton className={classes["sort"]} title={`Sort by ${title}`} onClick={onSort}>
            {title}
            {sorted && <Icon size={15} aria-hidden />}
          </UnstyledButton>
        )}{" "}
        {topic && <HelpTip topic={topic} />}
      </span>
      {detail && <small>{detail}</small>}
    </th>
  );
}

function Lines<Row>({ row, columns, marks, below, stacks }: RowProps<Row> & { row: Row }) {
  const more = below?.(row);
  return (
    <>
      <tr {...marks?.(row)}>
        {columns.map((column) => {
          const { title, id = title, isHeading, cell } = column;
          const Cell = isHeading ? "th" : "td";
          return (
            <Cell
              key={id}
              scope={isHeading ? "row" : undefined}
              className={classOf(column)}
              data-title={stacks ? title : undefined}
            >
              {cell(row)}
            </Cell>
          );
        })}
      </tr>
      {more && (
        <tr>
          <td colSpan={columns.length} className={classes["below"]}>
            {more}
          </td>
        </tr>
      )}
    </>
  );
}

function classOf<Row>({ isText, className = "" }: Column<Row>): string {
  return isText ? `${classes["text"]} ${className}` : className;
}
