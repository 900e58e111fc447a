import type { ReproductionRow } from "../../api/jobs";
import { ScrollTable } from "../../ui/ScrollTable";
import { type ComparedColumn, comparedColumns, grouped, measure } from "./jobs";
import classes from "./ReproductionRows.module.css";

const RATIO_DIGITS = 3;

/** Own and published numbers, grouped. */
export function ReproductionRows({ rows, title }: { rows: readonly ReproductionRow[]; title: string }) {
  const columns = comparedColumns(rows);
  return (
    <ScrollTable label={`${title}: numbers`} className={classes["table"]}>
      <thead>
        <tr>
          <td />
          <th scope="col">Ours</th>
          {columns.map(([key, heading]) => (
            <th key={key} scope="col">
              {heading}
            </th>
          ))}
        </tr>
      </thead>
      {grouped(rows).map((group) => (
        <tbody key={group.title}>
          <tr className={classes["group"]}>
            <th scope="rowgroup" colSpan={2 + columns.length}>
              {group.title}
            </th>
          </tr>
          {group.rows.map((row) => (
            <Row key={row.label} row={row} columns={columns} />
          ))}
        </tbody>
      ))}
    </ScrollTable>
  );
}

function Row({ row, columns }: { row: ReproductionRow; columns: readonly ComparedColumn[] }) {
  return (
    <tr>
      <th scope="row">
        {row.label} {row.note !== "" && <span className={classes["note"]}>{row.note}</span>}{" "}
        {row.overruled !== "" && (
          <span className={classes["note"]} title={row.overruled}>
            refused by the gate, overruled
          </span>
        )}
      </th>
      <td className={classes["ours"]}>
        {measure(row.measured, row.digits)} <span className={classes["unit"]}>{row.unit}</span>
      </td>
      {columns.map(([key]) => (
        <td key={key}>{measure(row[key], key === "ratio" ? RATIO_DIGITS : row.digits)}</td>
      ))}
    </tr>
  );
}
