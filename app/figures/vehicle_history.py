"""History of a vehicle over its flights: its fitted parameters, one small panel each, with their 95 % intervals; and
the voltage before and after each flight, by battery.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Final

from app.core.experiments.base import Fitted
from app.core.formatting import count
from app.core.statistics.drift import MONITORED_PARAMETERS
from app.figures import theme
from app.figures.base import Card, Cell, Column, Figure, Table, Trace, literal, scatter

REACH: Final = 1.96
"""Half width of a 95 % interval, in standard errors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One calibration: the flight of the vehicle after which it was made, and the parameters by name."""

    flight: int
    campaign_id: int
    trial_number: int
    fitted: Mapping[str, Fitted]


@dataclass(frozen=True, slots=True)
class CalibrationFigure(Figure):
    """Table columns: `flight`, `campaign`, `trial`, then each parameter with its standard error.

    `since` is the flight after which the vehicle was last tuned, drawn as a line in every panel.
    """

    points: tuple[Point, ...]
    since: int | None
    verdict: str
    name = "calibration"
    title = "Calibration history"

    def not_ready(self) -> str | None:
        if self.points:
            return None
        return "The model's fitted parameters appear here once a campaign with the calibrated model has flown."

    def compute(self) -> Card:
        names = [name for name in MONITORED_PARAMETERS if any(name in point.fitted for point in self.points)]
        first = {name: next(point.fitted[name] for point in self.points if name in point.fitted) for name in names}
        ticks = theme.flight_ticks(max(point.flight for point in self.points))
        titles = [f"<b>{one.title}</b>" + (f" ({one.unit})" if one.unit else "") for one in first.values()]
        panels = [(self.palette.note(title), {"nticks": 4, "rangemode": "normal"}) for title in titles]
        return self.ready(
            [self._panel(index, name) for index, name in enumerate(names, start=1)],
            summary=f"Bars are 95 % intervals. {self.verdict}",
            table=self._table(first),
            shapes=self._tuned(len(names)),
            **self.palette.titled_panels("Flight of this vehicle", ticks, panels),
        )

    def _panel(self, index: int, name: str) -> Trace:
        shown = [point for point in self.points if name in point.fitted]
        fitted = [point.fitted[name] for point in shown]
        return scatter(
            fitted[0].title,
            ([point.flight for point in shown], [each.value for each in fitted]),
            role="fitted",
            about={"parameter": name},
            mode="markers",
            **theme.on(index),
            error_y=theme.bars(
                self.palette.dim, 1.5, 4, type="data", array=[REACH * each.standard_error for each in fitted]
            ),
            marker=theme.solid(self.palette.best, size=8),
            text=[f"campaign {point.campaign_id}, flight {point.trial_number}" for point in shown],
            hovertemplate=f"<b>Flight %{{x}} of the vehicle</b> (%{{text}})<br>%{{y:.4g}} ± %{{error_y.array:.2g}} "
            f"{fitted[0].unit}<extra></extra>",
        )

    def _tuned(self, panels: int) -> list[dict[str, object]]:
        if self.since is None:
            return []
        return [
            theme.upright(self.since, self.palette.prediction, 1.5, xref=f"x{suffix}", yref=f"y{suffix} domain")
            for suffix in map(theme.suffix, range(1, panels + 1))
        ]

    def _table(self, first: Mapping[str, Fitted]) -> Table:
        columns = [
            Column("flight", "Flight of the vehicle", digits=0),
            Column("campaign", "Campaign", digits=0),
            Column("trial", "Its flight", digits=0),
        ]
        for name, one in first.items():
            columns += [Column(name, one.title, one.unit), Column(f"{name}_se", "Standard error", one.unit)]
        return Table(tuple(columns), tuple(_row(point, first) for point in self.points))


def _row(point: Point, names: Iterable[str]) -> tuple[Cell, ...]:
    fits = [point.fitted.get(name) for name in names]
    estimates = [(None, None) if fit is None else (fit.value, fit.standard_error) for fit in fits]
    return (point.flight, point.campaign_id, point.trial_number, *chain(*estimates))


_BEFORE_PX: Final = 14
_AFTER_PX: Final = 7
"""An unchanged voltage appears as a dot inside its ring."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryFlight:
    """One flight: its number in the vehicle's ledger, the battery's label, and its voltages, V."""

    flight: int
    battery: str
    before_v: float | None
    after_v: float | None


@dataclass(frozen=True, slots=True)
class BatteriesFigure(Figure):
    """Table columns: `flight`, `battery`, `before`, `after`. A line connects each voltage before with the one after."""

    flights: tuple[BatteryFlight, ...]
    name = "batteries"
    title = "Batteries"

    def not_ready(self) -> str | None:
        if any(flight.before_v is not None or flight.after_v is not None for flight in self.flights):
            return None
        return "Voltages before and after each flight appear here once a flight has reported them."

    def compute(self) -> Card:
        labels = list(dict.fromkeys(flight.battery for flight in self.flights))
        columns = (
            Column("flight", "Flight of the vehicle", digits=0),
            Column("battery", "Battery"),
            Column("before", "Before", "V", 2),
            Column("after", "After", "V", 2),
        )
        rows = tuple((one.flight, one.battery or "no label", one.before_v, one.after_v) for one in self.flights)
        return self.ready(
            [self._battery(place, label) for place, label in enumerate(labels)],
            summary=self._summary(labels),
            table=Table(columns, rows),
            xaxis=self.palette.axis("Flight of this vehicle", **theme.flight_ticks(len(self.flights))),
            yaxis=self.palette.axis("Voltage (V)"),
        )

    def _battery(self, place: int, label: str) -> Trace:
        colour = self.palette.gains[place % len(self.palette.gains)]
        own = [flight for flight in self.flights if flight.battery == label]
        symbols = (("circle-open", "circle"), ("square-open", "square"), ("diamond-open", "diamond"))
        before, after = symbols[(place // len(self.palette.gains) + place) % len(symbols)]
        return scatter(
            literal(label or "no label"),
            (
                [x for flight in own for x in (flight.flight, flight.flight, None)],
                [y for flight in own for y in (flight.before_v, flight.after_v, None)],
            ),
            role="battery",
            about={"battery": label},
            mode="lines+markers",
            line=theme.line(colour, 2),
            marker={
                "color": colour,
                "size": [_BEFORE_PX, _AFTER_PX, _AFTER_PX] * len(own),
                "opacity": 1,
                "symbol": [before, after, after] * len(own),
                "line": {"width": [2, 0, 0] * len(own), "color": colour},
            },
            hovertemplate=f"<b>Flight %{{x}}</b>, {literal(label or 'no label')}<br>%{{y:.2f}} V<extra></extra>",
        )

    def _summary(self, labels: list[str]) -> str:
        counts = ", ".join(
            f"{label or 'no label'}: {count(sum(flight.battery == label for flight in self.flights), 'flight')}"
            for label in labels
        )
        return f"Open marks: before a flight; smaller filled marks: after it. {counts}."
