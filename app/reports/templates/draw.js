"use strict";
const PRINTED_PX = 680; // 180 mm, what A4 leaves between its margins
const figures = JSON.parse(document.getElementById("figures").textContent);
const settings = { displayModeBar: false, displaylogo: false, responsive: true, showSendToCloud: false };
const charts = Object.keys(figures).map((name) => document.getElementById(`chart-${name}`));
Promise.all(
  Object.values(figures).map((figure, index) => Plotly.newPlot(charts[index], figure.data, figure.layout, settings)),
).then(() => {
  document.documentElement.dataset.drawn = String(charts.length);
});
addEventListener("beforeprint", () => charts.forEach((chart) => Plotly.relayout(chart, { width: PRINTED_PX })));
addEventListener("afterprint", () => charts.forEach((chart) => Plotly.relayout(chart, { width: null, autosize: true })));
