import { expect, test } from "vitest";
import { changeFrom, staleQueries } from "./staleQueries";

test("a changed trial makes its campaign, the lists and what flies doubtful", () => {
  expect(staleQueries([{ topic: "trial", entity_id: 9, campaign_id: 4 }])).toEqual([
    ["flying"],
    ["campaigns"],
    ["trial", 9],
    ["wear"],
    ["campaign", 4],
  ]);
});

test("a changed job makes the jobs doubtful, and one without a campaign the reproductions", () => {
  expect(staleQueries([{ topic: "job", entity_id: 3, campaign_id: null }])).toEqual([["jobs"], ["reproductions"]]);
  expect(staleQueries([{ topic: "job", entity_id: 3, campaign_id: 4 }])).toEqual([["jobs"], ["campaign", 4]]);
});

test("a changed vehicle makes itself and the list of vehicles doubtful", () => {
  const keys = staleQueries([{ topic: "vehicle", entity_id: 2, campaign_id: null }]);
  expect(keys).toEqual([["flying"], ["vehicles"], ["vehicle", 2], ["wear"]]);
});

test("new gains and a flight make doubtful what is known of the vehicles' wear", () => {
  expect(staleQueries([{ topic: "proposal", entity_id: 7, campaign_id: 4 }])).toContainEqual(["wear"]);
  expect(staleQueries([{ topic: "flight", entity_id: 7, campaign_id: 4 }])).toContainEqual(["wear"]);
  expect(staleQueries([{ topic: "job", entity_id: 7, campaign_id: 4 }])).not.toContainEqual(["wear"]);
});

test("many changes together ask for each answer once", () => {
  const changes = [
    { topic: "proposal", entity_id: 1, campaign_id: 4 },
    { topic: "campaign", entity_id: 4, campaign_id: 4 },
    { topic: "campaign", entity_id: 4, campaign_id: 4 },
  ];
  expect(staleQueries(changes)).toEqual([["flying"], ["wear"], ["campaign", 4], ["campaigns"]]);
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
