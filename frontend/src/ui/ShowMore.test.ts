import { InfiniteQueryObserver, QueryClient } from "@tanstack/react-query";
import { expect, test } from "vitest";
import { addPage } from "./ShowMore";

/** A list of five pages, and what lets the requests that wait be answered. */
function listOfPages() {
  const waiting: (() => void)[] = [];
  const client = new QueryClient();
  const list = new InfiniteQueryObserver(client, {
    queryKey: ["numbers"],
    queryFn: ({ pageParam }) => new Promise<number>((resolve) => waiting.push(() => resolve(pageParam))),
    initialPageParam: 1,
    getNextPageParam: (last: number) => (last < 5 ? last + 1 : null),
    select: ({ pages }) => ({ items: pages, total: 5 }),
  });
  list.subscribe(() => {});
  return {
    client,
    list,
    answer: async () => {
      await expect.poll(() => waiting.length).toBeGreaterThan(0);
      waiting.shift()?.();
    },
    pages: () => list.getCurrentResult().data?.items,
  };
}

test("the next page is added though news have the first one read again meanwhile", async () => {
  const { client, list, answer, pages } = listOfPages();
  await answer();
  await expect.poll(pages).toEqual([1]);
  const added = addPage(list.getCurrentResult());
  void client.invalidateQueries();
  await answer();
  await answer();
  await answer();
  await added;
  expect(pages()).toEqual([1, 2]);
});

test("the next page is added after what was being read already", async () => {
  const { client, list, answer, pages } = listOfPages();
  await answer();
  await expect.poll(pages).toEqual([1]);
  void client.invalidateQueries();
  const added = addPage(list.getCurrentResult());
  await answer();
  await answer();
  await added;
  expect(pages()).toEqual([1, 2]);
});

test("an answer that fails ends it", async () => {
  const { list, answer, pages } = listOfPages();
  await answer();
  await expect.poll(pages).toEqual([1]);
  const failed = { ...list.getCurrentResult(), isError: true } as const;
  await addPage({ ...failed, fetchNextPage: () => Promise.resolve(failed as never) });
  expect(pages()).toEqual([1]);
});
