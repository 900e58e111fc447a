import { Button, type ButtonProps } from "@mantine/core";
import type { UseInfiniteQueryResult } from "@tanstack/react-query";
import type { ReactNode } from "react";

interface Items {
  items: readonly unknown[];
  total: number;
}

type List = Pick<UseInfiniteQueryResult<Items>, "data" | "hasNextPage" | "isFetchingNextPage" | "fetchNextPage">;

interface Props extends ButtonProps {
  list: List;
  children?: ReactNode;
}

/** Adds the next page to a list that has one. */
export function ShowMore({ list, children, ...button }: Props) {
  if (!list.hasNextPage || list.data === undefined) return null;
  const { items, total } = list.data;
  return (
    <Button variant="default" loading={list.isFetchingNextPage} onClick={() => void addPage(list)} {...button}>
      {children ?? `Show more (${items.length} of ${total})`}
    </Button>
  );
}

const TRIES = 5;

/**
 * Add the next page to a list. An invalidation refetches the shown pages and replaces a pending request for the next
 * one, so the request is repeated until the page is there.
 */
export async function addPage({ data, fetchNextPage }: Pick<List, "data" | "fetchNextPage">): Promise<void> {
  const shown = data?.items.length ?? 0;
  for (let tried = 0; tried < TRIES; tried++) {
    const now = await fetchNextPage({ cancelRefetch: false });
    if (now.isError || !now.hasNextPage || (now.data?.items.length ?? 0) > shown) return;
  }
}
