import { QueryClient, QueryObserver } from "@tanstack/react-query";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { changeFrom, createInvalidator, type Invalidator, staleQueries } from "./staleQueries";

test("a changed trial makes its campaign, the lists and what flies doubtful", () => {
  expect(staleQueries([{ topic: "trial", entity_id: 9, campaign_id: 4 }])).toEqual([
    ["flying"],
    ["campaigns"],
    ["trial", 9],
    ["history"],
    ["campaign", 4],
  ]);
});

test("a changed job makes the jobs doubtful, and one without a campaign the reproductions", () => {
  expect(staleQueries([{ topic: "job", entity_id: 3, campaign_id: null }])).toEqual([["jobs"], ["reproductions"]]);
  expect(staleQueries([{ topic: "job", entity_id: 3, campaign_id: 4 }])).toEqual([["jobs"], ["campaign", 4]]);
});

test("a changed vehicle makes itself and the list of vehicles doubtful", () => {
  const keys = staleQueries([{ topic: "vehicle", entity_id: 2, campaign_id: null }]);
  expect(keys).toEqual([["flying"], ["vehicles"], ["vehicle", 2], ["campaigns"], ["history"]]);
});

test("new gains and a flight make doubtful what is known of the vehicles' history", () => {
  expect(staleQueries([{ topic: "proposal", entity_id: 7, campaign_id: 4 }])).toContainEqual(["history"]);
  expect(staleQueries([{ topic: "flight", entity_id: 7, campaign_id: 4 }])).toContainEqual(["history"]);
  expect(staleQueries([{ topic: "job", entity_id: 7, campaign_id: 4 }])).not.toContainEqual(["history"]);
});

test("many changes together ask for each answer once", () => {
  const changes = [
    { topic: "proposal", entity_id: 1, campaign_id: 4 },
    { topic: "campaign", entity_id: 4, campaign_id: 4 },
    { topic: "campaign", entity_id: 4, campaign_id: 4 },
  ];
  expect(staleQueries(changes)).toEqual([["flying"], ["history"], ["campaign", 4], ["campaigns"]]);
});

test("a line that is no change is left alone", () => {
  expect(changeFrom('{"topic":"trial","entity_id":9,"campaign_id":null}')).toEqual({
    topic: "trial",
    entity_id: 9,
    campaign_id: null,
  });
  expect(changeFrom('{"hello":1}')).toBeNull();
  expect(changeFrom("3")).toBeNull();
});

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

test("a change while an answer that nobody waits for is under way has it read once more when it is shown again", async () => {
  const { ask, change, answer } = server();
  const first = watched(ask);
  await answer();
  await vi.waitFor(() => expect(first.value()).toBe(1));
  invalidator.invalidate();
  first.unsubscribe();
  change();
  invalidator.invalidate();
  await answer();
  await vi.waitFor(() => expect(queries.isFetching()).toBe(0));
  const again = watched(ask);
  await answer();
  await vi.waitFor(() => expect(again.value()).toBe(2));
  again.unsubscribe();
});
