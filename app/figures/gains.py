"""The gains of each flight, one small panel per gain, with the next ones as open diamonds."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from app.core import formatting
from app.core.policy import Gain
from app.figures import theme
from app.figures.base import CampaignFigure, Card, Column, Table, Trace, scatter
from app.figures.overlays import MANY

_LETTERS: Final = 48
"""Of a name, on the narrowest screen."""


@dataclass(frozen=True, slots=True)
class GainsFigure(CampaignFigure):
    """Table columns: `flight`, then one per gain in its own unit; the proposal is the row `proposed`.

    Every trace carries `meta`: `role` (flown, best, next) and `gain`. A page puts other gains in the place of `next`.
    """

    name = "gains"
    title = "Gains per flight"

    def not_ready(self) -> str | None:
        if self.history.flights or self.history.proposal is not None:
            return None
        return "The gains of each flight appear here once the first ones are proposed."

    def compute(self) -> Card:
        gains, ticks = self.history.gains, theme.flight_ticks(self.history.last_number)
        return self.ready(
            [trace for index, gain in enumerate(gains, start=1) for trace in self._panel(index, gain)],
            summary=self._summary(),
            table=self._table(),
            **self.palette.titled_panels("Flight", ticks, list(self._ordinates())),
        )

    def _panel(self, index: int, gain: Gain) -> Iterator[Trace]:
        colour = self.palette.gains[(index - 1) % len(self.palette.gains)]
        flights, proposal, best = self.history.flights, self.history.proposal, self.history.best
        axes: dict[str, Any] = {**theme.on(index), "cliponaxis": False}
        unit = f" {gain.unit}" if gain.unit else ""
        crowded = len(flights) > MANY
        marker = theme.solid(
            colour,
            size=[13 if flight is best else 7 for flight in flights],
            symbol=["star" if flight is best else "circle" for flight in flights],
        )
        flown = scatter(
            gain.title,
            ([flight.number for flight in flights], [flight.gains[gain.name] for flight in flights]),
            role="flown",
            about={"gain": gain.name},
            mode="lines" if crowded else "lines+markers",
            line={**theme.line(colour, 1 if crowded else 2), "shape": "hv"},
            hovertemplate=f"<b>Flight %{{x}}</b><br>{gain.name} = %{{y:g}}{unit}<extra></extra>",
            **axes,
        )
        yield flown if crowded else flown | {"marker": marker}
        if crowded and best is not None:
            star = {
                "x": [best.number],
                "y": [best.gains[gain.name]],
                "marker": theme.solid(colour, size=13, symbol="star"),
            }
            yield {**flown, **star, "mode": "markers", "meta": {"role": "best", "gain": gain.name}}
        if proposal is not None:
            yield scatter(
                f"{gain.title}, next",
                ([proposal.number], [proposal.gains[gain.name]]),
                role="next",
                about={"gain": gain.name},
                mode="markers",
                marker={"size": 11, "symbol": "diamond-open", "color": self.palette.prediction, "line": {"width": 2}},
                hovertemplate=f"<b>Flight %{{x}}, next</b><br>{gain.name} = %{{y:g}}{unit}<extra></extra>",
                **axes,
            )

    def _ordinates(self) -> Iterator[tuple[dict[str, object], dict[str, Any]]]:
        """Name, title and unit of each gain above its panel, and its ordinate; where one would not fit, the titles show
        under the pointer."""
        gains, flights = self.history.gains, (*self.history.flights, *self.history.next_flights)
        fit = all(len(_label(gain.name, gain.title, gain)) <= _LETTERS for gain in gains)
        for gain in gains:
            values = [flight.gains[gain.name] for flight in flights]
            title = _label(f"<b>{gain.name}</b>", gain.title if fit else "", gain)
            ordinate = {"range": padded(min(values), max(values), gain), "nticks": 4 if len(gains) <= 3 else 3}
            yield self.palette.note(title, hovertext=gain.title), ordinate

    def _summary(self) -> str:
        best = self.history.best
        if best is None:
            return "No valid flight yet."
        return (
            f"Best gains, flight {best.number}: "
            + ", ".join(f"{gain.name} {formatting.gain(best.gains[gain.name])}" for gain in self.history.gains)
            + "."
        )

    def _table(self) -> Table:
        flown = [(str(flight.number), flight.gains) for flight in self.history.flights]
        if self.history.proposal is not None:
            flown.append(("proposed", self.history.proposal.gains))
        columns = (
            Column("flight", "Flight"),
            *(Column(gain.name, gain.title, gain.unit, 0 if gain.integer else None) for gain in self.history.gains),
        )
        return Table(
            columns, tuple((name, *(gains[gain.name] for gain in self.history.gains)) for name, gains in flown)
        )


def _label(name: str, title: str, gain: Gain) -> str:
    return " ".join(filter(None, (name, title, f"({gain.unit})" if gain.unit else "")))


def padded(low: float, high: float, gain: Gain) -> list[float]:
    """A range around `low` … `high`, at least half a scale wide, so that a change of one count looks small."""
    width = max(high - low, 0.5 * gain.scale)
    middle = (low + high) / 2
    return [max(gain.lower - 0.05 * width, middle - 0.65 * width), middle + 0.65 * width]
