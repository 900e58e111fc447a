"""Flights of any campaigns over the set point, and below them the difference of each from the first."""

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from app.figures import theme
from app.figures.base import Card, Cell, Column, Table, literal, plotly_json
from app.figures.data import Curve
from app.figures.scale import robust_span, thin_by_bends, thinned
from app.figures.theme import PALETTES, Palette, ThemeName

POINTS: Final = 600
TABLE_ROWS: Final = 34
DASHES: Final = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
LONGEST_NAME: Final = 34


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedCurve:
    """One flight: `label` is its letter, `name` its title; `curve` is None if it has no record."""

    trial_id: int
    label: str
    name: str
    curve: Curve | None
    error: float | None


Drawn = tuple[int, ComparedCurve, Curve]
"""A flight with its index among all flights, and its curve."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonData:
    """At least two flights, at most 36, the number of combinations of colour and dash."""

    output_title: str
    output_unit: str
    error_unit: str
    set_point: Curve
    flights: tuple[ComparedCurve, ...]


@dataclass(frozen=True, slots=True)
class ComparisonFigure:
    """Table columns: `time_s`, `set_point`, the flights by their letters (`a`, `b`, …), and `b_less_a` and so on.

    Every trace carries `meta`: `role` (set point, flight, difference, off scale) and, except for the set point,
    `trial`. A flight has the same colour and dash in both panels, and no other flight has the same combination.
    """

    data: ComparisonData
    theme: ThemeName = "light"
    name: ClassVar[str] = "comparing"
    title: ClassVar[str] = "Curves compared"

    def not_ready(self) -> str | None:
        return None if self._recorded() else "None of these flights has a record."

    def compute(self) -> Card:
        palette, recorded = PALETTES[self.theme], self._recorded()
        low, high, outside = self._span([curve for _, _, curve in recorded])
        traces = [self._set_point(palette)]
        traces += [self._flight(palette, index, flight, curve) for index, flight, curve in recorded]
        traces += [
            self._difference(palette, index, flight, curve) for index, flight, curve in self._differences(recorded)
        ]
        traces += [_off_scale(palette, recorded[place][1], recorded[place][2], low, high) for place in outside]
        return Card(
            name=self.name,
            title=self.title,
            state="ready",
            summary=self._summary(len(outside)),
            figure=plotly_json(traces, self._layout(palette, low, high)),
            table=self._table(recorded),
        )

    def _recorded(self) -> list[Drawn]:
        return [
            (index, flight, flight.curve)
            for index, flight in enumerate(self.data.flights)
            if flight.curve is not None and len(flight.curve.time_s)
        ]

    def _differences(self, recorded: list[Drawn]) -> list[Drawn]:
        """Difference of every other flight from the first, at the first one's times, where both were recorded."""
        first = self.data.flights[0].curve
        if first is None or len(first.time_s) == 0:
            return []
        return [(index, flight, _less(curve, first)) for index, flight, curve in recorded if index > 0]

    def _span(self, curves: list[Curve]) -> tuple[float, float, tuple[int, ...]]:
        goal = self.data.set_point.values
        low, high = min(0.0, float(goal.min())), max(0.0, float(goal.max()))
        if low == high:
            low, high = min(low, float(curves[0].values.min())), max(high, float(curves[0].values.max()))
        return robust_span([curve.values for curve in curves], low=low, high=high)

    def _layout(self, palette: Palette, low: float, high: float) -> dict[str, object]:
        data, end = self.data, float(self.data.set_point.time_s[-1])
        first = data.flights[0].label
        return theme.layout(
            palette,
            xaxis=theme.titled(palette, "Time since the command (s)", anchor="y2", range=[-0.01 * end, end]),
            yaxis=theme.titled(
                palette, f"{data.output_title} ({data.output_unit})", domain=[0.4, 1.0], range=[low, high], nticks=7
            ),
            yaxis2=theme.titled(
                palette,
                f"Less {first} ({data.output_unit})",
                domain=[0.0, 0.32],
                nticks=5,
                zeroline=True,
                zerolinecolor=palette.dim,
            ),
            uirevision="comparing",
        )

    def _set_point(self, palette: Palette) -> dict[str, object]:
        x, y = thin_by_bends(self.data.set_point.time_s, self.data.set_point.values)
        return {
            "type": "scatter",
            "mode": "lines",
            "name": "Set point",
            "x": x,
            "y": y,
            "line": theme.line(palette.dim, 1, "dot"),
            "meta": {"role": "set point"},
            "hoverinfo": "skip",
            "legendrank": 1100,
        }

    def _flight(self, palette: Palette, index: int, flight: ComparedCurve, curve: Curve) -> dict[str, object]:
        x, y = thinned(curve.time_s, curve.values, POINTS)
        error = "" if flight.error is None else f"<br>error {flight.error:.3f} {self.data.error_unit}"
        return {
            **self._line(palette, index, flight, "flight"),
            "name": literal(_shortened(f"{flight.label} · {flight.name}")),
            "x": x,
            "y": y,
            "hovertemplate": f"<b>{flight.label} · {literal(flight.name)}</b><br>%{{x:.2f}} s · %{{y:.3f}} "
            f"{self.data.output_unit}{error}<extra></extra>",
        }

    def _difference(self, palette: Palette, index: int, flight: ComparedCurve, curve: Curve) -> dict[str, object]:
        x, y = thinned(curve.time_s, curve.values, POINTS)
        first = self.data.flights[0].label
        return {
            **self._line(palette, index, flight, "difference"),
            "name": f"{flight.label} less {first}",
            "x": x,
            "y": y,
            "yaxis": "y2",
            "showlegend": False,
            "hovertemplate": f"<b>{flight.label} less {first}</b><br>%{{x:.2f}} s · %{{y:+.3f}} "
            f"{self.data.output_unit}<extra></extra>",
        }

    def _line(self, palette: Palette, index: int, flight: ComparedCurve, role: str) -> dict[str, object]:
        colour, dash = line_style(palette, index)
        return {
            "type": "scatter",
            "mode": "lines",
            "line": theme.line(colour, 2, dash),
            "legendgroup": flight.label,
            "meta": {"role": role, "trial": flight.trial_id},
        }

    def _summary(self, outside: int) -> str:
        data = self.data
        listed = "; ".join(
            f"{flight.label}, {flight.name}, "
            + ("no error" if flight.error is None else f"error {flight.error:.3f} {data.error_unit}")
            for flight in data.flights
        )
        off = f" {outside} off scale, marked at the edge." if outside else ""
        return (
            f"{data.output_title} of {len(data.flights)} flights over time, and below the difference of each from "
            f"{data.flights[0].label}: {listed}.{off}"
        )

    def _table(self, recorded: list[Drawn]) -> Table:
        data, first = self.data, self.data.flights[0].label
        named = [(Column("set_point", "Set point", data.output_unit, 3), data.set_point)]
        named += [
            (Column(flight.label.lower(), f"{flight.label} · {flight.name}", data.output_unit, 3), curve)
            for _, flight, curve in recorded
        ]
        named += [
            (
                Column(f"{flight.label.lower()}_less_{first.lower()}", f"{flight.label} less {first}",
                       data.output_unit, 3),
                curve,
            )
            for _, flight, curve in self._differences(recorded)
        ]  # fmt: skip
        end = float(data.set_point.time_s[-1])
        rows = tuple(
            (round(float(second), 2), *(_cell(curve, float(second)) for _, curve in named))
            for second in np.linspace(0.0, end, TABLE_ROWS)
        )
        return Table((Column("time_s", "Time", "s", 2), *(column for column, _ in named)), rows)


def line_style(palette: Palette, index: int) -> tuple[str, str]:
    """Colour and dash of the flight at an index; neighbours differ in both."""
    teal, orange, blue = palette.gains
    colours = (palette.ink, teal, orange, blue, palette.prediction, palette.bad)
    return colours[index % len(colours)], DASHES[(index + index // len(colours)) % len(DASHES)]


def _less(curve: Curve, first: Curve) -> Curve:
    shared = (first.time_s >= curve.time_s[0]) & (first.time_s <= curve.time_s[-1])
    time_s = first.time_s[shared]
    return Curve(time_s, np.interp(time_s, curve.time_s, curve.values) - first.values[shared])


def _cell(curve: Curve, time_s: float) -> Cell:
    value = curve.at(time_s)
    return None if value is None else round(value, 4)


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 1]}…"


def _off_scale(palette: Palette, flight: ComparedCurve, curve: Curve, low: float, high: float) -> dict[str, object]:
    """A triangle at the edge where a flight leaves the scale, labelled with its peak value."""
    up = bool(curve.values.max() - high >= low - curve.values.min())
    peak = int(curve.values.argmax() if up else curve.values.argmin())
    text = f"{flight.label} reaches {curve.values[peak]:.2f}"
    return {
        "type": "scatter",
        "mode": "markers+text",
        "name": text,
        "x": [round(float(curve.time_s[peak]), 3)],
        "y": [high if up else low],
        "text": [f"{flight.label} {'↑' if up else '↓'} {curve.values[peak]:.1f}"],
        "textposition": "bottom center" if up else "top center",
        "textfont": {"color": palette.bad},
        "marker": {"symbol": "triangle-up" if up else "triangle-down", "size": 12, "color": palette.bad},
        "showlegend": False,
        "cliponaxis": False,
        "meta": {"role": "off scale", "trial": flight.trial_id},
        "hovertemplate": f"{text}<extra></extra>",
    }
