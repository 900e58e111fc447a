import { expect, test } from "vitest";
import { withNextError, withNextGains } from "./nextFlight";
import type { PlotlyFigure } from "./traces";

const NOTHING = { gains: null, predictedError: null, interval: null };

const errors: PlotlyFigure = {
  data: [
    { meta: { role: "measured" }, x: [1, 2], y: [0.3, 0.2] },
    {
      meta: { role: "interval", next: 3 },
      x: [2, 2, null, 3, 3, null],
      y: [0.15, 0.25, null, 0.1, 0.14, null],
      text: ["a", "a", "a", "b", "b", "b"],
    },
    {
      meta: { role: "predicted", next: 3 },
      x: [2, 3],
      y: [0.2, 0.12],
      text: ["0.2000", "0.1200"],
      marker: { size: 13, symbol: ["diamond-open", "diamond-open"] },
    },
  ],
  layout: { yaxis: { range: [0, 0.35] } },
};

test("the next flight has the predicted error of the gains that are chosen, with its interval", () => {
  const drawn = withNextError(errors, { ...NOTHING, predictedError: 0.3, interval: { lower: -0.1, upper: 7 } });
  expect(drawn.data[0]).toBe(errors.data[0]);
  expect(drawn.data[1]).toMatchObject({
    x: [2, 2, null, 3, 3, null],
    y: [0.15, 0.25, null, 0, 0.35, null],
    text: ["a", "a", "a", ...Array(3).fill("-0.1000 … 7.0000")],
  });
  expect(drawn.data[2]).toMatchObject({ x: [2, 3], y: [0.2, 0.3], text: ["0.2000", "0.3000"] });
  const high = withNextError(errors, { ...NOTHING, predictedError: 2 });
  expect(high.data[2]).toMatchObject({
    y: [0.2, 0.35],
    text: ["0.2000", "2.0000"],
    marker: { size: 13, symbol: ["diamond-open", "triangle-up-open"] },
  });
});

test("gains without a prediction leave those of the flights that have flown", () => {
  const [, interval, predicted] = withNextError(errors, NOTHING).data;
  expect(interval).toMatchObject({ x: [2, 2, null], y: [0.15, 0.25, null], visible: true });
  expect(predicted).toMatchObject({ x: [2], y: [0.2], visible: true });
});

test("a prediction appears where the proposal has none", () => {
  const data = [{ meta: { role: "predicted", next: 2 }, x: [], y: [], text: [], visible: false }];
  const drawn = withNextError({ data, layout: {} }, { ...NOTHING, predictedError: 0.2 });
  expect(drawn.data[0]).toMatchObject({ x: [2], y: [0.2], visible: true });
  expect(withNextError({ data, layout: {} }, NOTHING).data[0]).toMatchObject({ x: [], visible: false });
});

const gains: PlotlyFigure = {
  data: [
    { meta: { role: "flown", gain: "kp" }, yaxis: "y", x: [1], y: [283] },
    { meta: { role: "next", gain: "kp" }, yaxis: "y", x: [2], y: [300] },
    { meta: { role: "next", gain: "ki" }, yaxis: "y2", x: [2], y: [13] },
  ],
  layout: { yaxis: { range: [200, 400], nticks: 4 }, yaxis2: { range: [0, 50] } },
};

test("the next flight has the gains that are chosen, and their axes room for them", () => {
  const drawn = withNextGains(gains, { ...NOTHING, gains: { kp: 700, ki: 20 } });
  expect(drawn.data.map(({ y }) => y)).toEqual([[283], [700], [20]]);
  expect(drawn.layout).toMatchObject({ yaxis: { range: [200, 740], nticks: 4 }, yaxis2: { range: [0, 50] } });
  expect(withNextGains(gains, { ...NOTHING, gains: { kp: 100, ki: 20 } }).layout["yaxis"]).toMatchObject({
    range: [76, 400],
  });
});

test("gains that are not known are not drawn", () => {
  const drawn = withNextGains(gains, NOTHING);
  expect(drawn.data.map(({ visible }) => visible)).toEqual([undefined, false, false]);
  expect(drawn.layout).toEqual(gains.layout);
});
