import { Button } from "@mantine/core";
import type { InfiniteData, InfiniteQueryObserverResult } from "@tanstack/react-query";
import { useState } from "react";

/** The last rows of a long table, and a row with a button that shows more. */
export function useLastRows<T>(
  rows: readonly T[],
  columns: number,
  what: string,
  kept: (row: T) => boolean,
  order: "earlier" | "further" = "earlier",
) {
  const [count, setCount] = useState(ROWS);
  const hidden = Math.max(0, rows.length - count);
  const more = hidden > 0 && (
    <tr>
      <td colSpan={columns} style={{ textAlign: "left" }}>
        <Button variant="default" onClick={() => setCount(count + MORE_ROWS)}>
          Show {Math.min(MORE_ROWS, hidden)} {order} {what} ({hidden} hidden)
        </Button>
      </td>
    </tr>
  );
  return { more, listed: lastRows(rows, count, kept) };
}

/** Long tables: the number of rows shown at first, and added on demand. */

const ROWS = 50;
const MORE_ROWS = 200;

/** The last `count` rows, and earlier rows for which `kept` is true. */
export function lastRows<T>(rows: readonly T[], count: number, kept: (row: T) => boolean): readonly T[] {
  const from = Math.max(0, rows.length - count);
  return from === 0 ? rows : [...rows.slice(0, from).filter(kept), ...rows.slice(from)];
}

type Pages<Page> = Pick<
  InfiniteQueryObserverResult<InfiniteData<Page>>,
  "data" | "hasNextPage" | "isError" | "fetchNextPage"
>;

const TRIES = 5;

/**
 * Add the next page to a list. An invalidation refetches the shown pages and replaces a pending request for the next
 * one, so the request is repeated until the page is there.
 */
export async function addPage<Page>(list: Pages<Page>): Promise<void> {
  const shown = list.data?.pages.length ?? 0;
  for (let tried = 0; tried < TRIES; tried++) {
    const now = await list.fetchNextPage({ cancelRefetch: false });
    if (now.isError || !now.hasNextPage || (now.data?.pages.length ?? 0) > shown) return;
  }
}
