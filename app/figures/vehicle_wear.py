"""Wear of a vehicle over its flights: its fitted parameters, one small panel each, with their 95 % intervals; and the
voltage before and after each flight, by battery.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

from app.core.statistics.drift import MONITORED_PARAMETERS, Fitted
from app.figures import theme
from app.figures.base import Card, Cell, Column, Table, literal, plotly_json
from app.figures.theme import PALETTES, Palette, ThemeName

REACH: Final = 1.96
"""Half width of a 95 % interval, in standard errors."""
_GAP: Final = 0.09


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One calibration: the flight of the vehicle after which it was made, and the parameters by name."""

    flight: int
    campaign_id: int
    trial_number: int
    fitted: Mapping[str, Fitted]


@dataclass(frozen=True, slots=True)
class CalibrationFigure:
    """Table columns: `flight`, `campaign`, `trial`, then each parameter with its standard error.

    `since` is the flight after which the vehicle was last tuned, drawn as a line in every panel.
    """

    points: tuple[Point, ...]
    since: int | None
    verdict: str
    theme: ThemeName = "light"
    name: ClassVar[str] = "calibration"
    title: ClassVar[str] = "Calibration history"

    def not_ready(self) -> str | None:
        if self.points:
            return None
        return "The model's fitted parameters appear here once a campaign with the calibrated model has flown."

    def compute(self) -> Card:
        palette, names = PALETTES[self.theme], self._names()
        axes: dict[str, object] = {}
        for index in range(1, len(names) + 1):
            axes |= self._axes(palette, index, len(names))
        layout = theme.layout(
            palette,
            showlegend=False,
            uirevision="calibration",
            margin={**theme.MARGIN_PX, "t": 24},
            annotations=[self._title(palette, index, name, len(names)) for index, name in enumerate(names, start=1)],
            shapes=self._tuned(palette, len(names)),
            **axes,
        )
        return Card(
            name=self.name,
            title=self.title,
            state="ready",
            summary=f"Bars are 95 % intervals. {self.verdict}",
            figure=plotly_json(
                [self._panel(palette, index, name) for index, name in enumerate(names, start=1)], layout
            ),
            table=self._table(names),
        )

    def _names(self) -> list[str]:
        return [name for name in MONITORED_PARAMETERS if any(name in point.fitted for point in self.points)]

    def _panel(self, palette: Palette, index: int, name: str) -> dict[str, object]:
        shown = [point for point in self.points if name in point.fitted]
        unit, suffix = shown[0].fitted[name].unit, _suffix(index)
        return {
            "type": "scatter",
            "mode": "markers",
            "name": shown[0].fitted[name].title,
            "xaxis": f"x{suffix}",
            "yaxis": f"y{suffix}",
            "x": [point.flight for point in shown],
            "y": [point.fitted[name].value for point in shown],
            "error_y": {
                "type": "data",
                "array": [REACH * point.fitted[name].standard_error for point in shown],
                "color": palette.dim,
                "thickness": 1.5,
                "width": 4,
            },
            "marker": theme.solid(palette.best, size=8),
            "text": [f"campaign {point.campaign_id}, flight {point.trial_number}" for point in shown],
            "meta": {"role": "fitted", "parameter": name},
            "hovertemplate": f"<b>Flight %{{x}} of the vehicle</b> (%{{text}})<br>%{{y:.4g}} ± %{{error_y.array:.2g}} "
            f"{unit}<extra></extra>",
        }

    def _axes(self, palette: Palette, index: int, count: int) -> dict[str, object]:
        bottom, height = _place(index, count)
        suffix, last = _suffix(index), max(point.flight for point in self.points)
        x = {
            "range": [0.5, last + 0.6],
            "dtick": max(1, -(-last // 12)),
            "showgrid": False,
            "showticklabels": index == count,
            "anchor": f"y{suffix}",
            "matches": None if index == 1 else "x",
        }
        axis_title = "Flight of this vehicle"
        return {
            f"xaxis{suffix}": theme.titled(palette, axis_title, **x) if index == count else theme.axis(palette, **x),
            f"yaxis{suffix}": theme.axis(
                palette, domain=[bottom, bottom + height], anchor=f"x{suffix}", nticks=4, rangemode="normal"
            ),
        }

    def _title(self, palette: Palette, index: int, name: str, count: int) -> dict[str, object]:
        fitted = next(point.fitted[name] for point in self.points if name in point.fitted)
        return {
            "text": f"<b>{fitted.title}</b> ({fitted.unit})",
            "x": 0,
            "y": sum(_place(index, count)),
            "xref": "paper",
            "yref": "paper",
            "xanchor": "left",
            "yanchor": "bottom",
            "showarrow": False,
            "font": {"size": 12, "color": palette.dim},
        }

    def _tuned(self, palette: Palette, count: int) -> list[dict[str, object]]:
        if self.since is None:
            return []
        return [
            {
                "type": "line",
                "xref": f"x{_suffix(index)}",
                "yref": f"y{_suffix(index)} domain",
                "x0": self.since,
                "x1": self.since,
                "y0": 0,
                "y1": 1,
                "layer": "below",
                "line": {"color": palette.prediction, "width": 1.5, "dash": "dot"},
            }
            for index in range(1, count + 1)
        ]

    def _table(self, names: list[str]) -> Table:
        first = {name: next(point.fitted[name] for point in self.points if name in point.fitted) for name in names}
        columns = [Column("flight", "Flight of the vehicle", digits=0), Column("campaign", "Campaign", digits=0)]
        columns.append(Column("trial", "Its flight", digits=0))
        for name in names:
            columns.append(Column(name, first[name].title, first[name].unit))
            columns.append(Column(f"{name}_se", "Standard error", first[name].unit))
        rows: list[tuple[Cell, ...]] = []
        for point in self.points:
            cells: list[Cell] = [point.flight, point.campaign_id, point.trial_number]
            for name in names:
                fitted = point.fitted.get(name)
                cells += [None, None] if fitted is None else [fitted.value, fitted.standard_error]
            rows.append(tuple(cells))
        return Table(tuple(columns), tuple(rows))


def _place(index: int, count: int) -> tuple[float, float]:
    """Bottom and height of a panel as shares of the whole; the first one is on top."""
    height = (1 - _GAP * (count - 1)) / count
    return max(0.0, 1 - index * height - (index - 1) * _GAP), height


def _suffix(index: int) -> str:
    return "" if index == 1 else str(index)


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
class BatteriesFigure:
    """Table columns: `flight`, `battery`, `before`, `after`. A line connects each voltage before with the one after."""

    flights: tuple[BatteryFlight, ...]
    theme: ThemeName = "light"
    name: ClassVar[str] = "batteries"
    title: ClassVar[str] = "Batteries"

    def not_ready(self) -> str | None:
        if any(flight.before_v is not None or flight.after_v is not None for flight in self.flights):
            return None
        return "Voltages before and after each flight appear here once a flight has reported them."

    def compute(self) -> Card:
        palette = PALETTES[self.theme]
        labels = list(dict.fromkeys(flight.battery for flight in self.flights))
        layout = theme.layout(
            palette,
            uirevision="batteries",
            xaxis=theme.titled(
                palette,
                "Flight of this vehicle",
                showgrid=False,
                range=[0.5, len(self.flights) + 0.5],
                dtick=max(1, len(self.flights) // 12),
            ),
            yaxis=theme.titled(palette, "Voltage (V)"),
        )
        return Card(
            name=self.name,
            title=self.title,
            state="ready",
            summary=self._summary(labels),
            figure=plotly_json([self._battery(palette, place, label) for place, label in enumerate(labels)], layout),
            table=Table(
                (
                    Column("flight", "Flight of the vehicle", digits=0),
                    Column("battery", "Battery"),
                    Column("before", "Before", "V", 2),
                    Column("after", "After", "V", 2),
                ),
                tuple((one.flight, one.battery or "no label", one.before_v, one.after_v) for one in self.flights),
            ),
        )

    def _battery(self, palette: Palette, place: int, label: str) -> dict[str, object]:
        colour = palette.gains[place % len(palette.gains)]
        own = [flight for flight in self.flights if flight.battery == label]
        symbols = (("circle-open", "circle"), ("square-open", "square"), ("diamond-open", "diamond"))
        before, after = symbols[(place // len(palette.gains) + place) % len(symbols)]
        return {
            "type": "scatter",
            "mode": "lines+markers",
            "name": literal(label or "no label"),
            "x": [x for flight in own for x in (flight.flight, flight.flight, None)],
            "y": [y for flight in own for y in (flight.before_v, flight.after_v, None)],
            "line": theme.line(colour, 2),
            "marker": {
                "color": colour,
                "size": [_BEFORE_PX, _AFTER_PX, _AFTER_PX] * len(own),
                "opacity": 1,
                "symbol": [before, after, after] * len(own),
                "line": {"width": [2, 0, 0] * len(own), "color": colour},
            },
            "meta": {"role": "battery", "battery": label},
            "hovertemplate": f"<b>Flight %{{x}}</b>, {literal(label or 'no label')}<br>%{{y:.2f}} V<extra></extra>",
        }

    def _summary(self, labels: list[str]) -> str:
        counted = [(label, sum(flight.battery == label for flight in self.flights)) for label in labels]
        counts = ", ".join(
            f"{label or 'no label'}: {count} flight{'s' if count > 1 else ''}" for label, count in counted
        )
        return f"Open marks: before a flight; smaller filled marks: after it. {counts}."
