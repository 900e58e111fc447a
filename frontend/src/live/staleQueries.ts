import type { InvalidateQueryFilters, QueryClient } from "@tanstack/react-query";

export interface Invalidator {
  /** Refetch matching queries; all queries without filters. */
  invalidate(filters?: InvalidateQueryFilters): void;
  stop(): void;
}

/**
 * Refetch queries after a change. The query client restarts neither a first fetch that is pending nor one of a query that
 * is not shown at the moment, although the response may be older than the change and would count as current: such a query
 * is invalidated again when the response is there.
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
      for (const query of cache.findAll({ ...filters, fetchStatus: "fetching" })) {
        if (query.state.data === undefined || !query.isActive()) awaited.add(query.queryHash);
      }
      void queries.invalidateQueries(filters);
    },
    stop: unsubscribe,
  };
}

/** Query keys that a change on the server invalidates. */

export interface Change {
  topic: string;
  entity_id: number;
  campaign_id: number | null;
}

export type QueryKey = readonly (string | number)[];

/** Topics that affect calibration history. Most do not name the vehicle, so all vehicles are invalidated. */
const TELLING = new Set(["campaign", "trial", "flight", "proposal", "vehicle"]);

function keysOf(change: Change): QueryKey[] {
  const keys: QueryKey[] = change.topic === "job" ? [["jobs"]] : [["flying"]];
  if (change.topic === "campaign" || change.topic === "trial") keys.push(["campaigns"]);
  if (change.topic === "trial") keys.push(["trial", change.entity_id]);
  if (change.topic === "vehicle") keys.push(["vehicles"], ["vehicle", change.entity_id], ["campaigns"]);
  if (TELLING.has(change.topic)) keys.push(["history"]);
  if (change.topic === "job" && change.campaign_id === null) keys.push(["reproductions"]);
  if (change.campaign_id !== null) keys.push(["campaign", change.campaign_id]);
  return keys;
}

/** The keys of all changes, each once. */
export function staleQueries(changes: readonly Change[]): QueryKey[] {
  const keys = new Map(changes.flatMap(keysOf).map((key) => [JSON.stringify(key), key]));
  return [...keys.values()];
}

export function changeFrom(json: string): Change | null {
  const parsed: unknown = JSON.parse(json);
  if (typeof parsed !== "object" || parsed === null) return null;
  const { topic, entity_id, campaign_id } = parsed as Record<string, unknown>;
  if (typeof topic !== "string" || typeof entity_id !== "number") return null;
  return { topic, entity_id, campaign_id: typeof campaign_id === "number" ? campaign_id : null };
}
