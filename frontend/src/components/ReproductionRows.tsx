import type { ReproductionRow } from "../api/work";
import { grouped, measure } from "../lib/work";
import classes from "./ReproductionRows.module.css";

/** Our numbers beside the published ones, under the headings of their groups. */
export function ReproductionRows({ rows, title }: { rows: readonly ReproductionRow[]; title: string }) {
  return (
    // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrolling region has to be reachable by keyboard
    <section className={`${classes["scroll"]} sideways`} aria-label={`${title}: numbers`} tabIndex={0}>
      <table className={classes["table"]}>
        <thead>
          <tr>
            <td />
            <th scope="col">Ours</th>
            <th scope="col">Paper</th>
            <th scope="col">Ratio</th>
            <th scope="col">Expected</th>
          </tr>
        </thead>
        {grouped(rows).map((group) => (
          <tbody key={group.title}>
            <tr className={classes["group"]}>
              <th scope="rowgroup" colSpan={5}>
                {group.title}
              </th>
            </tr>
            {group.rows.map((row) => (
              <Row key={row.label} row={row} />
            ))}
          </tbody>
        ))}
      </table>
    </section>
  );
}

function Row({ row }: { row: ReproductionRow }) {
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
      <td>{measure(row.paper, row.digits)}</td>
      <td>{measure(row.ratio, 3)}</td>
      <td>{measure(row.reference, row.digits)}</td>
    </tr>
  );
}
