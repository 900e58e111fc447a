"""A campaign's gains as a path over the model's error: contours over two gains at a time."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np

from app.core.policy import Gain, Gains
from app.core.tuning.landscape import Landscape, Slice
from app.figures import theme
from app.figures.base import Card, Cell, Column, Table, Trace, ready, scatter
from app.figures.data import FlightData, History
from app.figures.slices import (
    LEGEND,
    Box,
    Scale,
    contour_traces,
    holds,
    mark_box,
    number_box,
    number_position,
    numbers,
    padded,
    scale_of,
    to_edge,
)

LONGEST_PATH: Final = 60
"""Largest number of latest flights in the path; the first and the best are always included."""
_GAP: Final = 0.09
_STAR_PX: Final = 17
"""Size of the star, and of the best flight's own invisible mark under it, which keeps its number clear of the star."""
_STACK_GAP: Final = 0.085


@dataclass(frozen=True, slots=True)
class Tried:
    """One step evaluated on the model, and the error predicted there."""

    gains: Gains
    predicted_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """How the next gains were found: the error's gradient, the direction of the line, and the steps evaluated on it."""

    gradient: Gains
    direction: Gains
    tried: tuple[Tried, ...] = ()


@dataclass(frozen=True, slots=True)
class LandscapeFigure:
    """Table columns: `what`, one per gain, `predicted` and `measured` error; the rows are the flights, the steps
    evaluated, the proposal, and the lowest point of each slice.

    Each trace carries in `meta` its role (model, beyond, path, best, line, tried, proposed) and its slice, from 1.
    """

    history: History
    landscape: Landscape
    search: Search
    theme_name: theme.ThemeName = "light"
    stacked: bool = False
    name: ClassVar[str] = "landscape"
    title: ClassVar[str] = "Error landscape of the model"

    def not_ready(self) -> str | None:
        return None if self.landscape.slices else "Nothing to draw: fewer than two gains are free."

    def compute(self) -> Card:
        palette, slices = theme.PALETTES[self.theme_name], self.landscape.slices
        scale = scale_of(slices)
        traces: list[Trace] = []
        axes: dict[str, object] = {}
        for index, one in enumerate(slices, start=1):
            named = {LEGEND, *(trace["legendgroup"] for trace in traces)}
            traces += [
                trace | {"showlegend": trace["legendgroup"] not in named}
                for trace in self._slice(palette, index, one, scale)
            ]
            axes |= self._axes(palette, index, one)
        layout = theme.layout(
            palette,
            uirevision="landscape",
            margin={"l": 8, "r": 14, "t": 12, "b": 92 if self.stacked else 76},
            annotations=[self._note(palette, scale)],
            **axes,
        )
        return ready(self, traces, layout, summary=self._summary(scale), table=self._table())

    def _slice(self, palette: theme.Palette, index: int, one: Slice, scale: Scale) -> Iterator[Trace]:
        """All traces of a slice: the contours, then what lies over them."""
        yield from contour_traces(palette, index, one, scale, self.history.error_unit, self._taken(one))
        draw = partial(_marks, index, one)
        ends = to_edge(one, self.landscape.centre, self.search.direction)
        if ends is not None:
            name = "Along gradient" if self.search.tried else "To the optimum"
            yield draw(ends, "line", name, "lines", line=theme.line(palette.prediction, 2, "dot"))
        inside = [step for step in self.search.tried if holds(one, step.gains)]
        if inside:
            unit = self.history.error_unit
            yield draw(
                [step.gains for step in inside],
                "tried",
                "Tried on model",
                "markers",
                marker=theme.solid(palette.prediction, size=6, symbol="circle-open", line={"width": 1.5}),
                hovertext=[f"Tried: the model predicts {step.predicted_error:.4f} {unit}" for step in inside],
            )
        yield from self._path(palette, one, draw)
        yield from self._proposed(palette, draw)

    def _taken(self, one: Slice) -> list[Box]:
        """The room of all marks and numbers in a slice."""
        shown = self._shown()
        marked = [flight.gains for flight in (*shown, *self.history.next_flights)]
        texts = zip(shown, self._texts(one), strict=True)
        return [
            *(mark_box(one, gains) for gains in marked),
            *(mark_box(one, step.gains) for step in self.search.tried),
            *(number_box(one, flight.gains, text) for flight, text in texts if text),
        ]

    def _texts(self, one: Slice) -> list[str]:
        """The numbers beside the flights that are shown."""
        proposal = self.history.proposal
        return numbers(self._shown(), self.history.best, one, aside=None if proposal is None else proposal.gains)

    def _shown(self) -> list[FlightData]:
        """All flights, or if there are many, the latest together with the first and the best before them."""
        earlier = self.history.flights[:-LONGEST_PATH]
        kept = [flight for flight in earlier if flight is earlier[0] or flight is self.history.best]
        return [*kept, *self.history.flights[-LONGEST_PATH:]]

    def _path(self, palette: theme.Palette, one: Slice, draw: Callable[..., Trace]) -> Iterator[Trace]:
        flights, best = self._shown(), self.history.best
        if not flights:
            return
        unit, texts = self.history.error_unit, self._texts(one)
        stars = [flight is best for flight in flights]
        yield draw(
            [flight.gains for flight in flights],
            "path",
            "Flights in order" if len(flights) == len(self.history.flights) else f"Last {LONGEST_PATH} flights",
            "lines+markers+text",
            line=theme.line(palette.ink, 1.5),
            marker={
                "size": [_STAR_PX if star else 7 for star in stars],
                "opacity": [0 if star else 1 for star in stars],
                "color": palette.surface,
                "line": {"width": 1.5, "color": palette.ink},
            },
            text=texts,
            textposition=[
                number_position(one, flight.gains, text) for flight, text in zip(flights, texts, strict=True)
            ],
            textfont={"size": 12, "color": palette.ink, "weight": 700, "shadow": "auto"},
            hovertext=[_hover_text(flight, unit) for flight in flights],
        )
        if best is not None:
            yield draw(
                [best.gains],
                "best",
                f"Best, flight {best.number}",
                "markers",
                marker=_edged(palette, palette.best, size=_STAR_PX, symbol="star"),
                hovertext=[_hover_text(best, unit)],
            )

    def _proposed(self, palette: theme.Palette, draw: Callable[..., Trace]) -> Iterator[Trace]:
        proposal = self.history.proposal
        if proposal is None:
            return
        prediction = "" if proposal.predicted_error is None else f", predicted {proposal.predicted_error:.4f}"
        yield draw(
            [proposal.gains],
            "proposed",
            f"Next, flight {proposal.number}",
            "markers",
            marker=_edged(palette, palette.prediction, size=13, symbol="diamond"),
            hovertext=[
                f"Flight {proposal.number}, proposed{prediction} {self.history.error_unit if prediction else ''}"
            ],
        )

    def _axes(self, palette: theme.Palette, index: int, one: Slice) -> dict[str, object]:
        across, up = _place(index, len(self.landscape.slices), stacked=self.stacked)
        named = {gain.name: gain for gain in self.history.gains}
        suffix = theme.suffix(index)
        axes = (("x", "y", one.x, one.x_values, across, 5), ("y", "x", one.y, one.y_values, up, 6))
        return {
            f"{own}axis{suffix}": theme.axis(
                palette,
                _title(named[gain]),
                domain=place,
                anchor=f"{other}{suffix}",
                range=padded(values),
                nticks=ticks,
                showgrid=False,
            )
            for own, other, gain, values, place, ticks in axes
        }

    def _note(self, palette: theme.Palette, scale: Scale) -> dict[str, object]:
        """Text below the slices: where they lie, and the contour interval."""
        held = ", ".join(f"{name} {value:.4g}" for name, value in self.landscape.centre.items())
        between = "<br>" if self.stacked else " · "
        text = f"Slices through {held}{between}contours every {scale.step:g} {self.history.error_unit}"
        return theme.note(palette, text, y=0, yshift=-52, yanchor="top", align="left")

    def _summary(self, scale: Scale) -> str:
        pairs = ", ".join(f"{one.y} over {one.x}" for one in self.landscape.slices)
        held = ", ".join(f"{name} {value:g}" for name, value in self.landscape.centre.items())
        parts = [
            f"The error that the model predicts, {pairs}.",
            f"The slices are through {held}; flights with other values of them are drawn too.",
            f"Contours every {scale.step:g} {self.history.error_unit}; values above {scale.high:g} are shaded.",
        ]
        if self.landscape.still:
            still = self.landscape.still
            fixed = f"{', '.join(still)} {'is' if len(still) == 1 else 'are'} fixed"
            parts.append(f"The gains with the largest gradient are varied; {fixed}.")
        return " ".join(parts)

    def _table(self) -> Table:
        history = self.history
        columns = (
            Column("what", "What"),
            *(Column(gain.name, gain.title, gain.unit, 0 if gain.integer else None) for gain in history.gains),
            Column("predicted", "Predicted error", history.error_unit, 4),
            Column("measured", "Measured error", history.error_unit, 4),
        )
        rows: list[tuple[Cell, ...]] = [
            self._row(f"Flight {flight.number}", flight.gains, flight.predicted_error, flight.error)
            for flight in history.flights
        ]
        rows += [self._row("Tried on the model", step.gains, step.predicted_error, None) for step in self.search.tried]
        if history.proposal is not None:
            next_one = history.proposal
            rows.append(
                self._row(f"Flight {next_one.number}, proposed", next_one.gains, next_one.predicted_error, None)
            )
        for one in self.landscape.slices:
            gains, error = lowest(one, self.landscape.centre)
            rows.append(self._row(f"Lowest of {one.y} over {one.x}", gains, error, None))
        return Table(columns, tuple(rows))

    def _row(self, what: str, gains: Gains, predicted: float | None, measured: float | None) -> tuple[Cell, ...]:
        return (what, *(gains[gain.name] for gain in self.history.gains), predicted, measured)


def lowest(one: Slice, centre: Gains) -> tuple[dict[str, float], float]:
    """The gains with the lowest error in a slice, and that error."""
    errors = np.array([[np.inf if error is None else error for error in row] for row in one.errors])
    row, column = divmod(int(np.argmin(errors)), errors.shape[1])
    return {**centre, one.x: one.x_values[column], one.y: one.y_values[row]}, float(errors[row, column])


def _marks(index: int, one: Slice, gains: Sequence[Gains], role: str, name: str, mode: str, **more: Any) -> Trace:
    """A trace through these gains, projected onto the slice; a `hovertext` is shown with the two gains."""
    if "hovertext" in more:
        more["hovertemplate"] = f"<b>%{{hovertext}}</b><br>{one.x} %{{x:g}}, {one.y} %{{y:g}}<extra></extra>"
    return scatter(
        name,
        ([each[one.x] for each in gains], [each[one.y] for each in gains]),
        role=role,
        about={"slice": index},
        mode=mode,
        **theme.on(index),
        legendgroup=role,
        cliponaxis=True,
        **more,
    )


def _edged(palette: theme.Palette, colour: str, **mark: object) -> dict[str, object]:
    """A filled mark that stands out from the contours and the path."""
    return theme.solid(colour, **mark, line={"width": 1.5, "color": palette.surface})


def _hover_text(flight: FlightData, unit: str) -> str:
    error = "no error" if flight.error is None else f"{flight.error:.4f} {unit} measured"
    return f"Flight {flight.number}, {error}"


def _place(index: int, count: int, *, stacked: bool) -> tuple[list[float], list[float]]:
    """Horizontal and vertical domain of a slice: side by side, or stacked with the first on top."""
    gap = _STACK_GAP if stacked else _GAP
    size = (1.0 - gap * (count - 1)) / count
    first = (index - 1) * (size + gap)
    if stacked:
        return [0.0, 1.0], [max(0.0, 1.0 - first - size), 1.0 - first]
    return [first, min(1.0, first + size)], [0.0, 1.0]


def _title(gain: Gain) -> str:
    return f"{gain.name} ({gain.unit})" if gain.unit else gain.name
