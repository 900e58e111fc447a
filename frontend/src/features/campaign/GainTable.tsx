import type { Proposal } from "../../api/types";
import { gainText } from "../../ui/format";
import classes from "./NextFlight.module.css";

interface Props {
  changes: Proposal["changes"];
  unit: string;
  titles?: Readonly<Record<string, string>>;
}

/** Gains now and next, with the change of each. */
export function GainTable({ changes, unit, titles = {} }: Props) {
  return (
    <table className={classes["gains"]}>
      <caption className="visually-hidden">Gains now and proposed</caption>
      <thead>
        <tr>
          <th scope="col">Gain{unit && ` (${unit})`}</th>
          <th scope="col">Now</th>
          <th scope="col">Next</th>
          <th scope="col" className={classes["delta"]}>
            Change
          </th>
        </tr>
      </thead>
      <tbody>
        {Object.entries(changes).map(([name, { now, next, delta }]) => (
          <tr key={name}>
            <th scope="row">
              {name} {titles[name] && <small>{titles[name]}</small>}
            </th>
            <td className={classes["now"]} title={String(now)}>
              {gainText(now)}
            </td>
            <td className={classes["next"]} title={String(next)}>
              {gainText(next)}
            </td>
            <td className={classes["delta"]} data-same={delta === 0 || undefined}>
              {delta === 0 ? "same" : `${delta > 0 ? "+" : "−"}${gainText(Math.abs(delta))}`}
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
