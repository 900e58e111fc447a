import type { InfiniteData, InfiniteQueryObserverResult } from "@tanstack/react-query";

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
