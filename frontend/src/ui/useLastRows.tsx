import { Button } from "@mantine/core";
import { useState } from "react";
import { lastRows, MORE_ROWS, ROWS } from "./rows";

/** The last rows of a long table, and a first row with a button that shows more. */
export function useLastRows<T>(rows: readonly T[], columns: number, what: string, kept: (row: T) => boolean) {
  const [count, setCount] = useState(ROWS);
  const hidden = Math.max(0, rows.length - count);
  const more = hidden > 0 && (
    <tr>
      <td colSpan={columns} style={{ textAlign: "left" }}>
        <Button variant="default" onClick={() => setCount(count + MORE_ROWS)}>
          Show {Math.min(MORE_ROWS, hidden)} earlier {what} ({hidden} hidden)
        </Button>
      </td>
    </tr>
  );
  return { more, listed: lastRows(rows, count, kept) };
}
