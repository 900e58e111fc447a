"""The number of each flight over its order: an example of a figure."""

from dataclasses import dataclass

from app.figures.base import CampaignFigure, Card, Column, Table, scatter


@dataclass(frozen=True, slots=True)
class FlownOrderFigure(CampaignFigure):
    """Table columns: `flight`, and its `place` from 1."""

    name = "order"
    title = "Order of the flights"

    def not_ready(self) -> str | None:
        return None if self.history.flights else "The order appears after the first flight."

    def compute(self) -> Card:
        numbers = [flight.number for flight in self.history.flights]
        places = list(range(1, len(numbers) + 1))
        table = Table((Column("flight", "Flight"), Column("place", "Place")), tuple(zip(numbers, places, strict=True)))
        traces = [scatter("flights", (places, numbers), role="flown")]
        return self.ready(traces, summary=f"{len(numbers)} flights.", table=table)
