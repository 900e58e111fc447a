/** Lists that the server answers page by page. */

import { type InfiniteData, keepPreviousData, type QueryKey, useInfiniteQuery } from "@tanstack/react-query";

interface Page<Item> {
  items: Item[];
  total: number;
  next_cursor: string | null;
}

type Read<Item> = (query: { limit: number; cursor: string | null }) => Promise<Page<Item>>;

const joined = <Item>({ pages }: InfiniteData<Page<Item>>) => ({
  items: pages.flatMap(({ items }) => items),
  total: pages[0]?.total ?? 0,
});

/** The items of the pages read so far, and how many there are in all. */
export function usePages<Item>(queryKey: QueryKey, limit: number, read: Read<Item>, options?: { staleTime: number }) {
  return useInfiniteQuery({
    queryKey,
    queryFn: ({ pageParam: cursor }) => read({ limit, cursor }),
    initialPageParam: null as string | null,
    getNextPageParam: ({ next_cursor }) => next_cursor,
    placeholderData: keepPreviousData,
    select: joined,
    ...options,
  });
}

const LARGEST_PAGE = 200;

/** All items, page after page. */
export async function everyPage<Item>(read: Read<Item>): Promise<Item[]> {
  const all: Item[] = [];
  let cursor: string | null = null;
  do {
    const page: Page<Item> = await read({ limit: LARGEST_PAGE, cursor });
    all.push(...page.items);
    cursor = page.next_cursor;
  } while (cursor !== null);
  return all;
}
