import type { InfiniteData, InfiniteQueryObserverResult } from "@tanstack/react-query";

type Pages<Page> = Pick<
  InfiniteQueryObserverResult<InfiniteData<Page>>,
  "data" | "hasNextPage" | "isError" | "fetchNextPage"
>;

const TRIES = 5;

/**
 * Add the next page to a list. News that arrive meanwhile have the pages that are shown read again, and take the place
 * of a request for the next one: it is made again then, and waits for them where they came first.
 */
export async function addPage<Page>(list: Pages<Page>): Promise<void> {
  const shown = list.data?.pages.length ?? 0;
  for (let tried = 0; tried < TRIES; tried++) {
    const now = await list.fetchNextPage({ cancelRefetch: false });
    if (now.isError || !now.hasNextPage || (now.data?.pages.length ?? 0) > shown) return;
  }
}
