import { expect, test } from "vitest";
import { begun } from "./live";
import { clickedTrial, type Trace, traceWithRole, withChosen, withLive, withTimeRange } from "./traces";

const traces: Trace[] = [
  { meta: { role: "set point" }, x: [0, 32], y: [3, 3] },
  { meta: { role: "flight", trial: 1, standing: "earlier" }, line: { width: 1 }, x: [0, 1], y: [0, 2] },
  { meta: { role: "flight", trial: 2, standing: "best" }, line: { width: 3 }, x: [0, 1], y: [0, 3] },
  { meta: { role: "live" }, x: [], y: [], showlegend: false },
];

test("the live trace takes what has been measured, and only that trace", () => {
  const flight = { ...begun(1, 5), timeS: [0.1, 0.2], altitudeM: [0, 0.05] };
  const drawn = withLive(traces, flight);
  expect(drawn[3]).toMatchObject({ x: [0.1, 0.2], y: [0, 0.05], showlegend: true });
  expect(drawn.slice(0, 3)).toEqual(traces.slice(0, 3));
  expect(withLive(traces, null)).toEqual(traces);
});

test("a chosen flight stands out and the others step back", () => {
  const drawn = withChosen(traces, 1);
  expect(drawn[1]).toMatchObject({ line: { width: 3.5 } });
  expect(drawn[2]?.opacity).toBeLessThan(0.5);
  expect(drawn[0]?.opacity).toBeUndefined();
});

test("choosing a flight that is not drawn changes nothing", () => {
  expect(withChosen(traces, 9)).toEqual(traces);
  expect(withChosen(traces, null)).toEqual(traces);
});

test("a click on a flight's curve names the flight, a click on the set point nothing", () => {
  expect(clickedTrial(traces, 2)).toBe(2);
  expect(clickedTrial(traces, 0)).toBeNull();
  expect(clickedTrial(traces, 99)).toBeNull();
  expect(traceWithRole(traces, "live")).toBe(3);
});

test("the time axis can be cut without losing the rest of the layout", () => {
  const layout = { xaxis: { title: "Time", range: [0, 32.6] }, yaxis: { range: [0, 4] } };
  expect(withTimeRange(layout, [0, 10])).toMatchObject({
    xaxis: { title: "Time", range: [0, 10] },
    yaxis: layout.yaxis,
  });
  expect(withTimeRange(layout, null)).toBe(layout);
});
