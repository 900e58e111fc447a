"use strict";
const PRINTED_WIDTH = 680; // 180 mm, what A4 leaves between its margins
const figures = JSON.parse(document.getElementById("figures").textContent);
const settings = { displayModeBar: false, displaylogo: false, responsive: true, showSendToCloud: false };
const charts = Object.keys(figures).map((name) => document.getElementById(`chart-${name}`));
Promise.all(
  Object.values(figures).map((figure, index) => Plotly.newPlot(charts[index], figure.data, figure.layout, settings)),
).then(() => {
  document.documentElement.dataset.drawn = String(charts.length);
});
addEventListener("beforeprint", () => {
  document.documentElement.classList.add("printing");
  charts.forEach((chart) => Plotly.relayout(chart, { width: PRINTED_WIDTH, height: chart.clientHeight }));
});
addEventListener("afterprint", () => {
  document.documentElement.classList.remove("printing");
  charts.forEach((chart) => Plotly.relayout(chart, { width: null, height: null, autosize: true }));
});
