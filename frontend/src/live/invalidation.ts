import type { InvalidateQueryFilters, QueryClient } from "@tanstack/react-query";

export interface Invalidator {
  /** Refetch matching queries; all queries without filters. */
  invalidate(filters?: InvalidateQueryFilters): void;
  stop(): void;
}

/**
 * Refetch queries after a change. The query client does not restart a first fetch that is pending, although its response
 * may be older than the change: such a query is invalidated again when the response is there.
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
