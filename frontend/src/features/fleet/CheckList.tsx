import { IconAlertTriangle, IconCircleCheck } from "@tabler/icons-react";
import type { Vehicle } from "../../api/types";
import { Note } from "../../ui/Note";
import table from "../../ui/ScrollTable.module.css";
import { Time } from "../../ui/Time";
import classes from "./Fleet.module.css";

/** All items of the last preflight check. */
export function CheckList({ vehicle: { checks, checked_at } }: { vehicle: Vehicle }) {
  if (checks === null) {
    return <Note>Not checked yet. All items are checked again before every flight.</Note>;
  }
  return (
    <>
      <div className={table["scroll"]}>
        <table className={`${table["table"]} ${classes["table"]}`}>
          <thead>
            <tr>
              <th scope="col">Item</th>
              <th scope="col">Result</th>
              <th scope="col">Found</th>
            </tr>
          </thead>
          <tbody>
            {checks.map(({ name, title, passed, found, needed, hint }) => (
              <tr key={name}>
                <th scope="row">
                  {title}
                  {!passed && hint && <small>{hint}</small>}
                </th>
                <td>
                  {passed ? (
                    <span className={classes["good"]}>
                      <IconCircleCheck size={18} aria-hidden /> passed
                    </span>
                  ) : (
                    <span className={classes["bad"]}>
                      <IconAlertTriangle size={18} aria-hidden /> failed
                    </span>
                  )}
                </td>
                <td>
                  {found}
                  <small>required: {needed}</small>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <Note>
        Checked <Time at={checked_at} />.
      </Note>
    </>
  );
}
