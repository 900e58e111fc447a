import { QueryClient, QueryObserver } from "@tanstack/react-query";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { createInvalidator, type Invalidator } from "./invalidation";

let queries: QueryClient;
let invalidator: Invalidator;

beforeEach(() => {
  queries = new QueryClient({ defaultOptions: { queries: { staleTime: Infinity, retry: false } } });
  invalidator = createInvalidator(queries);
});

afterEach(() => {
  invalidator.stop();
  queries.clear();
});

/** A server that answers, when it is let, with what it has read when it was asked. */
function server() {
  let value = 1;
  const waiting: (() => void)[] = [];
  return {
    ask: () => {
      const read = value;
      return new Promise<number>((done) => waiting.push(() => done(read)));
    },
    change: () => {
      value += 1;
    },
    answer: async () => {
      await vi.waitFor(() => expect(waiting).not.toHaveLength(0));
      waiting.shift()?.();
    },
    asked: () => waiting.length,
  };
}

function watched(ask: () => Promise<number>) {
  const observer = new QueryObserver(queries, { queryKey: ["campaign", 4, "figure"], queryFn: ask });
  const unsubscribe = observer.subscribe(() => undefined);
  return { value: () => observer.getCurrentResult().data, unsubscribe };
}

test("a change while the first answer is under way has it read once more", async () => {
  const { ask, change, answer } = server();
  const { value, unsubscribe } = watched(ask);
  change();
  invalidator.invalidate({ queryKey: ["campaign", 4] });
  await answer();
  await vi.waitFor(() => expect(value()).toBe(1));
  await answer();
  await vi.waitFor(() => expect(value()).toBe(2));
  unsubscribe();
});

test("a change to something else has nothing read once more", async () => {
  const { ask, answer, asked } = server();
  const { value, unsubscribe } = watched(ask);
  invalidator.invalidate({ queryKey: ["campaign", 5] });
  await answer();
  await vi.waitFor(() => expect(value()).toBe(1));
  expect(queries.isFetching()).toBe(0);
  expect(asked()).toBe(0);
  unsubscribe();
});

test("a change after the first answer has it read again", async () => {
  const { ask, change, answer } = server();
  const { value, unsubscribe } = watched(ask);
  await answer();
  await vi.waitFor(() => expect(value()).toBe(1));
  change();
  invalidator.invalidate();
  await answer();
  await vi.waitFor(() => expect(value()).toBe(2));
  unsubscribe();
});
