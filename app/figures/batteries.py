"""Voltage before and after each flight of a vehicle, by battery."""

from dataclasses import dataclass
from typing import ClassVar, Final

from app.figures import theme
from app.figures.base import Card, Column, Table, literal, plotly_json
from app.figures.theme import PALETTES, Palette, ThemeName

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
        return "Voltages before and after each flight appear here once a flight has told them."

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
        told = ", ".join(f"{label or 'no label'}: {count} flight{'s' if count > 1 else ''}" for label, count in counted)
        return f"Open marks are before a flight, the smaller full ones after it. {told}."
