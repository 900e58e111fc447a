import { expect, test } from "vitest";
import { begun } from "../live/telemetry";
import {
  flightAt,
  marksOver,
  narrowed,
  roomFor,
  type Trace,
  traceWithRole,
  windowFrom,
  withChosen,
  withLimit,
  withLive,
  withPrediction,
  withTimeRange,
} from "./traces";

const traces: Trace[] = [
  { meta: { role: "target" }, x: [0, 32], y: [3, 3] },
  { meta: { role: "flight", trial: 1, standing: "earlier" }, line: { width: 1 }, x: [0, 1], y: [0, 2] },
  { meta: { role: "flight", trial: 2, standing: "best" }, line: { width: 3 }, x: [0, 1], y: [0, 3] },
  { meta: { role: "live" }, x: [], y: [], showlegend: false },
];

test("the live trace takes what has been measured, and only that trace", () => {
  const flight = { ...begun(1, 5), timeS: [0.1, 0.2], measured: [0, 0.05] };
  const drawn = withLive(traces, flight);
  expect(drawn[3]).toMatchObject({ x: [0.1, 0.2], y: [0, 0.05], showlegend: true });
  expect(drawn.slice(0, 3)).toEqual(traces.slice(0, 3));
  expect(withLive(traces, null)).toEqual(traces);
});

test("the live deviation is what has been measured less the set point, from the command on", () => {
  const step: Trace = { meta: { role: "target" }, x: [-0.3, 0, 0, 2, 4, 32], y: [0, 0, 3, 3, 5, 5] };
  const drawn = withLive([step, { meta: { role: "live deviation" }, x: [], y: [] }], {
    ...begun(1, 5),
    timeS: [-0.1, 0, 1, 3, 33],
    measured: [0, 0.1, 2.5, 4.5, 5.25],
  });
  const y = [-2.9, -0.5, Number.NaN, 0.5, Number.NaN, 0.25];
  expect(drawn[1]).toMatchObject({ x: [0, 1, 1, 3, 3, 33], y, showlegend: false });
});

test("no line is drawn over an interval without samples, as while the server was restarted", () => {
  const drawn = withLive(traces, { ...begun(1, 5), timeS: [0.5, 1.5, 4, 4.5], measured: [1, 2, 3, 3.1] });
  expect(drawn[3]).toMatchObject({ x: [0.5, 1.5, 1.5, 4, 4.5], y: [1, 2, Number.NaN, 3, 3.1] });
});

test("the altitude limit is shown within the axis, and nothing changes without one", () => {
  const limit: Trace = { meta: { role: "limit" }, x: [0, 32], y: [4.5, 4.5], visible: false };
  const drawn = withLimit({ data: [...traces, limit], layout: { yaxis: { range: [0, 3.5], nticks: 7 } } }, 0);
  expect(drawn.data.at(-1)?.["visible"]).toBe(true);
  const { range, nticks } = drawn.layout["yaxis"] as { range: [number, number]; nticks: number };
  expect(range[0]).toBe(0);
  expect(range[1]).toBeGreaterThan(4.5);
  expect(range[1]).toBeLessThan(5);
  expect(nticks).toBe(7);
  const without = { data: traces, layout: {} };
  expect(withLimit(without, 0)).toBe(without);
});

test("the only flight of a legend entry, once it is chosen, has its own entry alone", () => {
  const legend: Trace = { meta: { role: "legend", standing: "earlier" } };
  const other: Trace = { meta: { role: "flight", trial: 3, standing: "earlier" } };
  expect(withChosen([...traces, legend], 1).at(-1)?.["visible"]).toBe(false);
  expect(withChosen([...traces, legend], 2).at(-1)).toEqual(legend);
  expect(withChosen([...traces, other, legend], 1).at(-1)).toEqual(legend);
});

test("a chosen flight stands out and the others step back", () => {
  const drawn = withChosen(traces, 1);
  expect(drawn[1]).toMatchObject({ line: { width: 3.5 }, legendgroup: "chosen", showlegend: true });
  expect(drawn[2]?.opacity).toBeLessThan(0.5);
  expect(drawn[0]?.opacity).toBeUndefined();
});

test("choosing a flight that is not drawn changes nothing", () => {
  expect(withChosen(traces, 9)).toEqual(traces);
  expect(withChosen(traces, null)).toEqual(traces);
});

test("a point of a flight's curve or a mark over its number names the flight, the set point nothing", () => {
  const marks: Trace[] = [{ meta: { role: "measured" }, x: [1, 2, 4], y: [0.3, 0.2, 0.1] }];
  expect(flightAt(traces, 2, 0.5)).toBe(2);
  expect(flightAt(traces, 0, 0.5)).toBeNull();
  expect(flightAt(traces, 99, 0.5)).toBeNull();
  expect(flightAt(marks, 0, 4)).toBe(4);
  expect(flightAt([{ meta: { role: "off scale deviation", trial: 3 }, x: [2.1] }], 0, 2.1)).toBe(3);
  expect(marksOver(marks, 4)).toEqual([{ curveNumber: 0, pointNumber: 2 }]);
  expect(marksOver(marks, 3)).toEqual([]);
  expect(traceWithRole(traces, "live")).toBe(3);
});

test("an axis grows with a live curve that leaves it, and only then", () => {
  expect(roomFor([-0.2, 3.6], [0, 3.5])).toEqual([-0.2, 3.6]);
  expect(roomFor([0, 3.6], [0, 5, 4])).toEqual([0, 5.5]);
  expect(roomFor([0, 3.6], [])).toEqual([0, 3.6]);
});

test("a narrow screen gets a smaller legend of the same colours", () => {
  const unseen = { name: "Likely, lower edge", showlegend: false };
  const named = [{ name: "Predicted" }, { name: "To beat: 0.155" }, {}, unseen];
  expect(narrowed({ legend: { font: { color: "red", size: 12 } }, xaxis: {} }, named, 328)).toEqual({
    legend: { font: { color: "red", size: 11 }, entrywidth: 5.8 * 14, entrywidthmode: "pixels" },
    xaxis: {},
  });
});

test("names in a narrow screen's legend stand two to a row, or in full where that would cut them short", () => {
  const margin = { l: 48, r: 14 };
  const widthFor = (name: string) => narrowed({ margin }, [{ name }], 328)["legend"];
  expect(widthFor("80 % of 9 flights")).toMatchObject({ entrywidth: (328 - 48 - 14) / 2 - 45 });
  expect(widthFor("A · flight 2 of On twin")).toMatchObject({ entrywidth: 5.8 * 23 });
});

test("the time axis can be cut without losing the rest of the layout", () => {
  const layout = { xaxis: { title: "Time", range: [0, 32.6] }, yaxis: { range: [0, 4] } };
  expect(withTimeRange(layout, [0, 10])).toMatchObject({
    xaxis: { title: "Time", range: [0, 10] },
    yaxis: layout.yaxis,
  });
  expect(withTimeRange(layout, null)).toBe(layout);
});

test("a zoom says which seconds are looked at, and the way back that it is all of them", () => {
  expect(windowFrom({ "xaxis.range[0]": 2, "xaxis.range[1]": 4 }, [0, 32])).toEqual([2, 4]);
  expect(windowFrom({ "xaxis.range": [2, 4] }, [0, 32])).toEqual([2, 4]);
  expect(windowFrom({ "xaxis.range[0]": 0, "xaxis.range[1]": 32 }, [0, 32])).toBeNull();
  expect(windowFrom({ "yaxis.range[0]": 0 }, [0, 32])).toBeUndefined();
});

test("the predicted deviation belongs to the prediction that is drawn, from the command on", () => {
  const predicted: Trace[] = [
    { meta: { role: "target" }, x: [0, 2, 4, 32], y: [3, 3, 5, 5] },
    { meta: { role: "prediction", trial: 3 }, x: [0, 32], y: [0, 5] },
    { meta: { role: "predicted deviation", trial: 3 }, yaxis: "y2", x: [0, 32], y: [-3, 0] },
  ];
  const curve = { time_s: [-0.1, 0, 1, 3, 33], values: [0, 0.1, 2.5, 4.5, 5.25] };
  const [, , deviation] = withPrediction(predicted, { curve, lower: null, upper: null });
  expect(deviation).toMatchObject({ yaxis: "y2", x: [0, 1, 3, 33], y: [-2.9, -0.5, 0.5, 0.25] });
  expect(withPrediction(predicted, { curve: null, lower: null, upper: null })[2]).toMatchObject({ x: [], y: [] });
  expect(withPrediction(predicted, null)).toEqual(predicted);
});

test("another prediction takes the place of the figure's, with its band, and leaves the flights", () => {
  const predicted: Trace[] = [
    ...traces,
    { meta: { role: "band", edge: "lower" }, x: [0], y: [1] },
    { meta: { role: "band", edge: "upper" }, x: [0], y: [2] },
    { meta: { role: "prediction", trial: 3 }, x: [0], y: [1.5] },
  ];
  const curve = { time_s: [0, 1], values: [0, 2.9] };
  const drawn = withPrediction(predicted, { curve, lower: { time_s: [0, 2], values: [0, 2] }, upper: null });
  expect(drawn.slice(0, 4)).toEqual(traces);
  expect(drawn.slice(4)).toMatchObject([
    { x: [0, 2], y: [0, 2] },
    { x: [], y: [] },
    { meta: { trial: 3 }, x: [0, 1], y: [0, 2.9] },
  ]);
  expect(withPrediction(predicted, null).slice(4)).toMatchObject(predicted.slice(4));
});
