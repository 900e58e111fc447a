"""A campaign's gains as a path over the model's error, two gains at a time: a part of the proposal's details."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor, log10
from typing import Final

import numpy as np

from app.core.policy import Gains
from app.core.tuning.landscape import Landscape, Slice
from app.figures import theme
from app.figures.base import CampaignFigure, Card, Column, Table, Trace, scatter
from app.figures.data import FlightData

LEVELS: Final = 9
"""Approximate number of contours."""
SHOWN_SHARE: Final = 0.8
"""Share of all points covered by the scale."""
_TINTS: Final = ((0.0, 0.5), (0.3, 0.26), (1.0, 0.0))
"""Strength of the colour from the bottom to the top of the scale: the lower the error, the stronger the colour."""
_GAP: Final = 0.085
"""Height between two slices as a share of the whole."""
_EDGE: Final = 0.03
"""Room for marks on the edge of a slice, as a share of its range."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Contours from `low` to `high` every `step`, in the error's unit; higher values have no colour."""

    low: float
    high: float
    step: float


def scale_of(slices: Sequence[Slice]) -> Scale:
    """Common scale of all slices: from the lowest error to the 80 % quantile of their points, in steps of 1, 2 or 5."""
    errors = np.array([error for one in slices for row in one.errors for error in row if error is not None])
    low, high = float(errors.min()), float(np.quantile(errors, SHOWN_SHARE))
    width = max(high - low, 1e-3 * max(abs(high), 1e-9)) / LEVELS
    decade = 10.0 ** floor(log10(width))
    step = next(round(factor * decade, 12) for factor in (1, 2, 5, 10) if factor * decade >= width)
    return Scale(low=floor(low / step) * step, high=ceil(high / step) * step, step=step)


@dataclass(frozen=True, slots=True)
class LandscapeFigure(CampaignFigure):
    """Table columns: `what`, one per gain, `predicted` and `measured` error; the rows are the flights, the proposal,
    and the lowest point of each slice. `tried` are gains that the strategy evaluated on the model.

    Each trace carries in `meta` its role: model, path, best, tried, proposed.
    """

    landscape: Landscape
    tried: Sequence[Gains] = ()
    name = "landscape"
    title = "Error landscape of the model"

    def compute(self) -> Card:
        slices = self.landscape.slices
        scale = scale_of(slices)
        traces: list[Trace] = []
        axes: dict[str, object] = {}
        for index, one in enumerate(slices, start=1):
            drawn = (self._contours(one, scale), *self._marks(one))
            traces += [
                trace | theme.on(index) | {"legendgroup": trace["name"], "showlegend": index == 1} for trace in drawn
            ]
            axes |= self._axes(index, one)
        return self.ready(
            traces,
            summary=self._summary(scale),
            table=self._table(),
            margin={"l": 8, "r": 14, "t": 12, "b": 92},
            annotations=[self._note(scale)],
            **axes,
        )

    def _contours(self, one: Slice, scale: Scale) -> Trace:
        best, surface = self.palette.best, self.palette.surface
        return {
            "type": "contour",
            "name": "Predicted error",
            "x": list(one.x_values),
            "y": list(one.y_values),
            "z": [list(row) for row in one.errors],
            "zmin": scale.low,
            "zmax": scale.high,
            "contours": {
                "start": scale.low,
                "end": scale.high,
                "size": scale.step,
                "coloring": "fill",
                "showlabels": True,
                "labelfont": {"size": 11, "color": self.palette.ink},
            },
            "colorscale": [[place, theme.mixed(best, surface, share)] for place, share in _TINTS],
            "showscale": False,
            "line": {"width": 0.9, "color": theme.with_opacity(self.palette.dim, 0.75), "smoothing": 0},
            "meta": {"role": "model"},
            "hovertemplate": f"{one.x} %{{x:.4~g}}, {one.y} %{{y:.4~g}}<br>"
            f"<b>%{{z:.4f}} {self.history.error_unit}</b> predicted<extra></extra>",
        }

    def _marks(self, one: Slice) -> Iterator[Trace]:
        """The flights in order, the best of them, and the gains that were tried and that are proposed."""
        flights, best, proposal = self.history.flights, self.history.best, self.history.proposal
        edge = {"width": 1.5, "color": self.palette.surface}
        if self.tried:
            mark = theme.solid(self.palette.prediction, size=6, symbol="circle-open", line={"width": 1.5})
            yield _points(one, self.tried, "tried", "Tried on model", marker=mark)
        if flights:
            yield _points(
                one,
                [flight.gains for flight in flights],
                "path",
                "Flights in order",
                mode="lines+markers+text",
                line=theme.line(self.palette.ink, 1.5),
                marker={"size": 7, "color": self.palette.surface, "line": {"width": 1.5, "color": self.palette.ink}},
                text=self._numbers(one),
                textposition="top center",
                textfont={"size": 12, "color": self.palette.ink, "weight": 700, "shadow": "auto"},
                hovertext=[self._hover_text(flight) for flight in flights],
            )
        if best is not None:
            mark, hover = theme.solid(self.palette.best, size=17, symbol="star", line=edge), [self._hover_text(best)]
            yield _points(one, [best.gains], "best", f"Best, flight {best.number}", marker=mark, hovertext=hover)
        if proposal is not None:
            mark = theme.solid(self.palette.prediction, size=13, symbol="diamond", line=edge)
            name, hover = f"Next, flight {proposal.number}", [f"Flight {proposal.number}, proposed"]
            yield _points(one, [proposal.gains], "proposed", name, marker=mark, hovertext=hover)

    def _numbers(self, one: Slice) -> list[str]:
        """The numbers of the first, the best and the latest flight, in one text where they have the same place."""
        flights, best = self.history.flights, self.history.best
        leading = {flight.number: flight for flight in (flights[0], best or flights[0], flights[-1])}
        shared = defaultdict[tuple[float, float], list[int]](list)
        for number, flight in sorted(leading.items()):
            shared[flight.gains[one.x], flight.gains[one.y]].append(number)
        texts = {numbers[0]: ", ".join(map(str, numbers)) for numbers in shared.values()}
        return [texts.get(flight.number, "") for flight in flights]

    def _hover_text(self, flight: FlightData) -> str:
        unit = self.history.error_unit
        error = "no error" if flight.error is None else f"{flight.error:.4f} {unit} measured"
        return f"Flight {flight.number}, {error}"

    def _axes(self, index: int, one: Slice) -> dict[str, object]:
        titles = {gain.name: f"{gain.name} ({gain.unit})" if gain.unit else gain.name for gain in self.history.gains}
        own, up = theme.suffix(index), theme.stacked(index, len(self.landscape.slices), _GAP)
        x: dict[str, object] = {"anchor": f"y{own}", "range": _padded(one.x_values), "nticks": 5, "showgrid": False}
        y = {"anchor": f"x{own}", "range": _padded(one.y_values), "nticks": 6, "showgrid": False, "domain": up}
        return {
            f"xaxis{own}": self.palette.axis(titles[one.x], **x),
            f"yaxis{own}": self.palette.axis(titles[one.y], **y),
        }

    def _note(self, scale: Scale) -> dict[str, object]:
        """Text below the slices: where they lie, and the contour interval."""
        held = ", ".join(f"{name} {value:.4g}" for name, value in self.landscape.centre.items())
        text = f"Slices through {held}<br>contours every {scale.step:g} {self.history.error_unit}"
        return self.palette.note(text, y=0, yshift=-52, yanchor="top", align="left")

    def _summary(self, scale: Scale) -> str:
        pairs = ", ".join(f"{one.y} over {one.x}" for one in self.landscape.slices)
        held = ", ".join(f"{name} {value:g}" for name, value in self.landscape.centre.items())
        still = self.landscape.still
        fixed = f"{', '.join(still)} {'is' if len(still) == 1 else 'are'} fixed"
        parts = [
            f"The error that the model predicts, {pairs}.",
            f"The slices are through {held}; flights with other values of them are drawn too.",
            f"Contours every {scale.step:g} {self.history.error_unit}, up to {scale.high:g}.",
            *([f"The gains with the largest gradient are varied; {fixed}."] if still else []),
        ]
        return " ".join(parts)

    def _table(self) -> Table:
        history, gains = self.history, self.history.gains
        columns = (
            Column("what", "What"),
            *(Column(gain.name, gain.title, gain.unit, 0 if gain.integer else None) for gain in gains),
            Column("predicted", "Predicted error", history.error_unit, 4),
            Column("measured", "Measured error", history.error_unit, 4),
        )
        rows = [(f"Flight {each.number}", each.gains, each.predicted_error, each.error) for each in history.flights]
        if (next_one := history.proposal) is not None:
            rows.append((f"Flight {next_one.number}, proposed", next_one.gains, next_one.predicted_error, None))
        rows += [
            (f"Lowest of {one.y} over {one.x}", *lowest(one, self.landscape.centre), None)
            for one in self.landscape.slices
        ]
        return Table(columns, tuple((what, *(at[gain.name] for gain in gains), *errors) for what, at, *errors in rows))


def lowest(one: Slice, centre: Gains) -> tuple[dict[str, float], float]:
    """The gains with the lowest error in a slice, and that error."""
    errors = np.array([[np.inf if error is None else error for error in row] for row in one.errors])
    row, column = divmod(int(np.argmin(errors)), errors.shape[1])
    return {**centre, one.x: one.x_values[column], one.y: one.y_values[row]}, float(errors[row, column])


def _points(
    one: Slice,
    gains: Sequence[Gains],
    role: str,
    name: str,
    *,
    mode: str = "markers",
    hovertext: Sequence[str] = (),
    **more: object,
) -> Trace:
    """A trace through these gains, projected onto the slice; a `hovertext` is shown with the two gains."""
    if hovertext:
        shown = f"<b>%{{hovertext}}</b><br>{one.x} %{{x:g}}, {one.y} %{{y:g}}<extra></extra>"
        more |= {"hovertext": hovertext, "hovertemplate": shown}
    places = [each[one.x] for each in gains], [each[one.y] for each in gains]
    return scatter(name, places, role=role, about={}, mode=mode, cliponaxis=True, **more)


def _padded(values: Sequence[float]) -> list[float]:
    room = _EDGE * (values[-1] - values[0])
    return [values[0] - room, values[-1] + room]
