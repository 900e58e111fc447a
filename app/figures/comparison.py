"""Flights of any campaigns over the set point, and below them the difference of each from the first."""

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from app.core.formatting import short
from app.figures import theme
from app.figures.base import Card, Table, Trace, literal, reading, ready, scatter, table_of_curves
from app.figures.data import Curve, Scored
from app.figures.overlays import off_scale
from app.figures.scale import span_around, thin_by_bends, thinned

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


@dataclass(frozen=True, kw_only=True)
class ComparisonData(Scored):
    """At least two flights, at most 36, the number of combinations of colour and dash."""

    error_unit: str
    flights: tuple[ComparedCurve, ...]


@dataclass(frozen=True, slots=True)
class ComparisonFigure:
    """Table columns: `time_s`, `set_point`, the flights by their letters (`a`, `b`, …), and `b_less_a` and so on.

    Every trace carries `meta`: `role` (set point, flight, difference, off scale) and, except for the set point,
    `trial`. A flight has the same colour and dash in both panels, and no other flight has the same combination.
    """

    data: ComparisonData
    theme_name: theme.ThemeName = "light"
    name: ClassVar[str] = "comparing"
    title: ClassVar[str] = "Curves compared"

    def not_ready(self) -> str | None:
        return None if self._recorded() else "None of these flights has a record."

    def compute(self) -> Card:
        palette, recorded = theme.PALETTES[self.theme_name], self._recorded()
        low, high, outside = span_around(self.data.set_point.values, [curve.values for *_, curve in recorded])
        traces = [self._set_point(palette)]
        traces += [self._flight(palette, index, flight, curve) for index, flight, curve in recorded]
        traces += [
            self._difference(palette, index, flight, curve) for index, flight, curve in self._differences(recorded)
        ]
        traces += [
            off_scale(
                flight.label,
                curve,
                low,
                high,
                palette.bad,
                trial=flight.trial_id,
                text=flight.label,
                unit=self.data.output_unit,
            )
            for _, flight, curve in (recorded[place] for place in outside)
        ]
        return ready(
            self,
            traces,
            self._layout(palette, low, high),
            summary=self._summary(len(outside)),
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

    def _layout(self, palette: theme.Palette, low: float, high: float) -> dict[str, object]:
        data, end = self.data, float(self.data.set_point.time_s[-1])
        first = data.flights[0].label
        return theme.layout(
            palette,
            xaxis=theme.axis(palette, "Time since the command (s)", anchor="y2", range=[-0.01 * end, end]),
            yaxis=theme.axis(
                palette, f"{data.output_title} ({data.output_unit})", domain=[0.4, 1.0], range=[low, high], nticks=7
            ),
            yaxis2=theme.axis(
                palette,
                f"Difference from {first} ({data.output_unit})",
                domain=[0.0, 0.32],
                nticks=5,
                zeroline=True,
                zerolinecolor=palette.dim,
            ),
            uirevision="comparing",
        )

    def _set_point(self, palette: theme.Palette) -> Trace:
        return scatter(
            "Set point",
            thin_by_bends(self.data.set_point.time_s, self.data.set_point.values),
            role="set point",
            line=theme.line(palette.dim, 1, "dot"),
            legendrank=1100,
        )

    def _flight(self, palette: theme.Palette, index: int, flight: ComparedCurve, curve: Curve) -> Trace:
        error = "" if flight.error is None else f"<br>error {short(flight.error)} {self.data.error_unit}"
        return scatter(
            literal(_shortened(f"{flight.label} · {flight.name}")),
            thinned(curve.time_s, curve.values, POINTS),
            role="flight",
            about={"trial": flight.trial_id},
            line=pen(palette, index),
            legendgroup=flight.label,
            hovertemplate=reading(f"{flight.label} · {literal(flight.name)}", self.data.output_unit, error),
        )

    def _difference(self, palette: theme.Palette, index: int, flight: ComparedCurve, curve: Curve) -> Trace:
        name = f"{flight.label} minus {self.data.flights[0].label}"
        return scatter(
            name,
            thinned(curve.time_s, curve.values, POINTS),
            role="difference",
            about={"trial": flight.trial_id},
            line=pen(palette, index),
            legendgroup=flight.label,
            yaxis="y2",
            showlegend=False,
            hovertemplate=reading(name, self.data.output_unit, form="+.3f"),
        )

    def _summary(self, outside: int) -> str:
        data = self.data
        listed = "; ".join(
            f"{flight.label}, {flight.name}, "
            + ("no error" if flight.error is None else f"error {short(flight.error)} {data.error_unit}")
            for flight in data.flights
        )
        off = f" {outside} off scale, marked at the edge." if outside else ""
        return (
            f"{data.output_title} of {len(data.flights)} flights over time, and below it the difference of each from "
            f"{data.flights[0].label}: {listed}.{off}"
        )

    def _table(self, recorded: list[Drawn]) -> Table:
        data, first = self.data, self.data.flights[0].label
        named = [
            ("set_point", "Set point", data.set_point),
            *((flight.label.lower(), f"{flight.label} · {flight.name}", curve) for _, flight, curve in recorded),
            *(
                (f"{flight.label.lower()}_less_{first.lower()}", f"{flight.label} minus {first}", curve)
                for _, flight, curve in self._differences(recorded)
            ),
        ]
        seconds = np.linspace(0.0, float(data.set_point.time_s[-1]), TABLE_ROWS)
        return table_of_curves(seconds.tolist(), 2, data.output_unit, named)


def pen(palette: theme.Palette, index: int) -> dict[str, object]:
    """Line of the flight at an index; neighbours differ in colour and dash."""
    teal, orange, blue = palette.gains
    colours = (palette.ink, teal, orange, blue, palette.prediction, palette.bad)
    return theme.line(colours[index % len(colours)], 2, DASHES[(index + index // len(colours)) % len(DASHES)])


def _less(curve: Curve, first: Curve) -> Curve:
    shared = (first.time_s >= curve.time_s[0]) & (first.time_s <= curve.time_s[-1])
    time_s = first.time_s[shared]
    return Curve(time_s, np.interp(time_s, curve.time_s, curve.values) - first.values[shared])


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 1]}…"
