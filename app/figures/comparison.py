"""Flights of any campaigns over the set point, and below them the difference of each from the first."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.core.formatting import short
from app.figures import theme
from app.figures.base import Card, Figure, Table, Trace, literal, reading, scatter, table_of_curves
from app.figures.data import Curve, Scored, span_around, thin_by_bends, thinned
from app.figures.overlays import off_scale

POINTS: Final = 600
TABLE_ROWS: Final = 34
DASHES: Final = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
LONGEST_NAME: Final = 34


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedCurve:
    """One flight: its `index` among all, `label` is its letter, `name` its title; `curve` is empty without a record."""

    index: int
    trial_id: int
    label: str
    name: str
    curve: Curve
    error: float | None


@dataclass(frozen=True, kw_only=True)
class ComparisonData(Scored):
    """At least two flights, at most 36, the number of combinations of colour and dash."""

    error_unit: str
    flights: tuple[ComparedCurve, ...]


@dataclass(frozen=True, slots=True)
class ComparisonFigure(Figure):
    """Table columns: `time_s`, `set_point`, the flights by their letters (`a`, `b`, …), and `b_less_a` and so on.

    Every trace carries `meta`: `role` (set point, flight, difference, off scale) and, except for the set point,
    `trial`. A flight has the same colour and dash in both panels, and no other flight has the same combination.
    """

    data: ComparisonData
    name = "comparing"
    title = "Curves compared"

    def not_ready(self) -> str | None:
        return None if self._recorded() else "None of these flights has a record."

    def compute(self) -> Card:
        palette, data, recorded = self.palette, self.data, self._recorded()
        first, end, unit = data.flights[0].label, float(data.set_point.time_s[-1]), data.output_unit
        low, high, outside = span_around(data.set_point.values, [flight.curve.values for flight in recorded])
        traces = [
            scatter(
                "Set point",
                thin_by_bends(data.set_point),
                role="set point",
                line=theme.line(palette.dim, 1, "dot"),
                legendrank=1100,
            ),
            *map(self._flight, recorded),
            *map(self._difference, self._differences()),
        ]
        traces += [
            off_scale(
                flight.label, flight.curve, low, high, palette.bad, trial=flight.trial_id, text=flight.label, unit=unit
            )
            for flight in (recorded[place] for place in outside)
        ]
        zero = {"zeroline": True, "zerolinecolor": palette.dim}
        return self.ready(
            traces,
            summary=self._summary(len(outside)),
            table=self._table(),
            xaxis=palette.axis("Time since the command (s)", anchor="y2", range=[-0.01 * end, end]),
            yaxis=palette.axis(f"{data.output_title} ({unit})", domain=[0.4, 1.0], range=[low, high], nticks=7),
            yaxis2=palette.axis(f"Difference from {first} ({unit})", domain=[0.0, 0.32], nticks=5, **zero),
        )

    def _recorded(self) -> list[ComparedCurve]:
        return [flight for flight in self.data.flights if flight.curve]

    def _differences(self) -> list[ComparedCurve]:
        """Difference of every other flight from the first, at the first one's times, where both were recorded."""
        first, *others = self._recorded()
        if first is not self.data.flights[0]:
            return []
        return [replace(flight, curve=_less(flight.curve, first.curve)) for flight in others]

    def _flight(self, flight: ComparedCurve) -> Trace:
        error = "" if flight.error is None else f"<br>error {short(flight.error)} {self.data.error_unit}"
        return scatter(
            literal(_shortened(f"{flight.label} · {flight.name}")),
            thinned(flight.curve, POINTS),
            role="flight",
            about={"trial": flight.trial_id},
            line=pen(self.palette, flight.index),
            legendgroup=flight.label,
            hovertemplate=reading(f"{flight.label} · {literal(flight.name)}", self.data.output_unit, error),
        )

    def _difference(self, flight: ComparedCurve) -> Trace:
        name = f"{flight.label} minus {self.data.flights[0].label}"
        return scatter(
            name,
            thinned(flight.curve, POINTS),
            role="difference",
            about={"trial": flight.trial_id},
            line=pen(self.palette, flight.index),
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

    def _table(self) -> Table:
        data, first = self.data, self.data.flights[0].label
        named = [
            ("set_point", "Set point", data.set_point),
            *((flight.label.lower(), f"{flight.label} · {flight.name}", flight.curve) for flight in self._recorded()),
            *(
                (f"{flight.label.lower()}_less_{first.lower()}", f"{flight.label} minus {first}", flight.curve)
                for flight in self._differences()
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
    shared = first.part((first.time_s >= curve.time_s[0]) & (first.time_s <= curve.time_s[-1]))
    return Curve(shared.time_s, np.interp(shared.time_s, curve.time_s, curve.values) - shared.values)


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 1]}…"
