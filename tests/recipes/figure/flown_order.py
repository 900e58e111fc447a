"""The number of each flight over its order: an example of a figure."""

from dataclasses import dataclass
from typing import ClassVar

from app.figures import theme
from app.figures.base import Card, Column, Table, ready, scatter
from app.figures.data import History


@dataclass(frozen=True, slots=True)
class FlownOrderFigure:
    """Table columns: `flight`, and its `place` from 1."""

    history: History
    theme_name: theme.ThemeName = "light"
    name: ClassVar[str] = "order"
    title: ClassVar[str] = "Order of the flights"

    def not_ready(self) -> str | None:
        return None if self.history.flights else "The order appears after the first flight."

    def compute(self) -> Card:
        numbers = [flight.number for flight in self.history.flights]
        places = list(range(1, len(numbers) + 1))
        table = Table((Column("flight", "Flight"), Column("place", "Place")), tuple(zip(numbers, places, strict=True)))
        traces = [scatter("flights", (places, numbers), role="flown")]
        layout = theme.layout(theme.PALETTES[self.theme_name])
        return ready(self, traces, layout, summary=f"{len(numbers)} flights.", table=table)
