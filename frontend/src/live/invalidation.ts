import type { InvalidateQueryFilters, QueryClient } from "@tanstack/react-query";

export interface Invalidator {
  /** Have what matches read again; everything, without filters. */
  invalidate(filters?: InvalidateQueryFilters): void;
  stop(): void;
}

/**
 * Reads again what a change has made doubtful. An answer that is just being waited for and is the first of its kind is
 * not asked for anew by the query client, though it may have been read before the change: it is read once more when it
 * is there.
 */
export function createInvalidator(queries: QueryClient): Invalidator {
  const cache = queries.getQueryCache();
  const awaited = new Set<string>();
  const unsubscribe = cache.subscribe((event) => {
    if (event.type !== "updated" || event.action.type !== "success") return;
    const { queryHash, queryKey } = event.query;
    if (awaited.delete(queryHash)) void queries.invalidateQueries({ queryKey, exact: true });
  });
  return {
    invalidate(filters = {}) {
      for (const { state, queryHash } of cache.findAll({ ...filters, fetchStatus: "fetching" })) {
        if (state.data === undefined) awaited.add(queryHash);
      }
      void queries.invalidateQueries(filters);
    },
    stop: unsubscribe,
  };
}
