"""One flight as in a log viewer: altitude with prediction, set point and reference, and below it, over the same time,
its deviation, climb rate, throttle and battery, with the flight's events.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.records.flight_events import FlightEvent
from app.figures import theme
from app.figures.base import Card, Figure, Table, Trace, literal, scatter, table_of_curves
from app.figures.data import NO_CURVE, Band, Curve, Range, Scored, robust_span, thin_by_bends, thinned
from app.figures.deviations import deviation_axis, deviation_of, is_step, scored_deviation_limit, scored_part
from app.figures.overlays import band_traces, glitch_traces

POINTS: Final = 1200
TABLE_ROWS: Final = 34
_GAP: Final = 0.035
_OUTPUT_SHARE: Final = 2.0
"""Height of the output's panel, in heights of the others."""

_NAME_PX: Final = 70
"""Length of an event's name."""
_NEAR: Final = 0.04
"""Distance of two lines that leaves no room for a name between them, as a share of the record."""
_FIRST_NAME: Final = 0.025
"""Room for the first event's name before the command, as a share of the record."""
_NOTE_LETTERS: Final = 36
"""Longer notes are shortened to fit into the output's panel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelPanel:
    """Further channels by title, all in one `unit`, empty for shares; the axis has the `title`.

    `limits` are those between which a command acts, None if there are none: outside them it is saturated.
    """

    title: str
    unit: str = ""
    curves: Mapping[str, Curve]
    limits: Range | None = None


@dataclass(frozen=True, kw_only=True)
class FlightRecordData(Scored):
    """One recorded flight, with what else was recorded in `panels`, from top to bottom. `is_over`: it has flown, so a
    record that is missing will not follow by itself."""

    number: int
    curve: Curve
    predicted: Curve = NO_CURVE
    predicted_name: str = "Predicted"
    band: Band | None = None
    glitches: tuple[Range, ...] = ()
    best: Curve | None = None
    best_number: int | None = None
    panels: tuple[ChannelPanel, ...] = ()
    events: tuple[FlightEvent, ...] = ()
    notes: tuple[FlightEvent, ...] = ()
    is_over: bool = False


@dataclass(frozen=True, slots=True)
class FlightFigure(Figure):
    """Table columns: `time_s`, `measured`, `set_point`, `predicted` (if known), then the other channels by title.

    Every trace carries `meta`: `role` (set point, reference, best, prediction, flight, band, glitch, deviation, input,
    saturated). Events and pinned notes are lines with their names. All panels share one axis of time, so that they zoom
    together and the cursor reads all of them.
    """

    record: FlightRecordData
    name = "flight"
    title = "Flight record"

    def not_ready(self) -> str | None:
        if self.record.curve:
            return None
        return (
            "No record of this flight was received."
            if self.record.is_over
            else "There is no record of this flight yet."
        )

    def compute(self) -> Card:
        record, curve = self.record, self.record.curve
        traces = [
            *band_traces(self.palette, record.band),
            *self._context(),
            _line(f"Flight {record.number}", curve, self.palette.ink, 2.5, "flight", record.output_unit),
            *glitch_traces(self.palette, record.number, curve, record.glitches, record.output_unit),
            *self._deviation(),
            *self._channels(),
        ]
        return self.ready(traces, summary=self._summary(), table=self._table(), **self._layout())

    @property
    def _has_deviation(self) -> bool:
        return is_step(self.record.set_point)

    def _deviation(self) -> Iterator[Trace]:
        record = self.record
        if not self._has_deviation:
            return
        deviation = scored_part(deviation_of(record.curve, record.target), record.set_point)
        drawn = _line("Deviation", deviation, self.palette.ink, 1.75, "deviation", record.output_unit)
        yield {**drawn, "yaxis": "y2", "showlegend": False}

    def _channels(self) -> Iterator[Trace]:
        colours = (self.palette.ink, *self.palette.gains)
        for place, panel in enumerate(self.record.panels, start=2 + self._has_deviation):
            axis: Trace = {"yaxis": f"y{place}"} | ({"showlegend": False} if len(panel.curves) == 1 else {})
            for index, (title, curve) in enumerate(panel.curves.items()):
                colour, dash = colours[index % len(colours)], ("solid", "dash", "dot")[index % 3]
                yield _line(title, curve, colour, 1.5, "input", panel.unit, dash) | axis
            if panel.limits is not None:
                command = next(iter(panel.curves.values()))
                yield from (one | axis for one in _saturated(self.palette, command, panel.limits))

    def _layout(self) -> dict[str, object]:
        """The output on top, twice as high as each panel below it."""
        record, curve, goal = self.record, self.record.curve, self.record.set_point
        low, high, _ = robust_span(
            [curve.values], low=min(0.0, float(goal.values.min())), high=max(0.0, float(goal.values.max()))
        )
        places = _places(len(record.panels) + self._has_deviation)
        output = f"{record.output_title} ({record.output_unit})"
        axes: dict[str, object] = {"yaxis": self.palette.axis(output, domain=places[0], range=[low, high])}
        if self._has_deviation:
            axes["yaxis2"] = deviation_axis(
                self.palette, scored_deviation_limit(curve, record.target, goal), record.output_unit, domain=places[1]
            )
        for place, panel in enumerate(record.panels, start=2 + self._has_deviation):
            axes[f"yaxis{place}"] = self.palette.axis(panel.title, domain=places[place - 1], nticks=4)
        lasts_s = float(goal.time_s[-1])
        begin = min(float(curve.time_s[0]), -_FIRST_NAME * lasts_s) - 0.01 * lasts_s
        axes["xaxis"] = self.palette.axis(
            "Time since the command (s)",
            anchor=f"y{theme.suffix(len(places))}",
            range=[begin, float(curve.time_s[-1])],
            showspikes=True,
            spikemode="across",
            spikesnap="cursor",
            spikethickness=1,
            spikedash="solid",
            spikecolor=self.palette.dim,
            hoverformat=".2f",
            unifiedhovertitle={"text": "%{x} s"},
        )
        return {
            **axes,
            "hovermode": "x unified",
            "hoversubplots": "axis",
            "shapes": [
                *(theme.upright(event.time_s, self.palette.dim, 1, yref="paper") for event in record.events),
                *(theme.upright(note.time_s, self.palette.prediction, 1, yref="paper") for note in record.notes),
            ],
            "annotations": [
                *_names(self.palette, record.events, lasts_s),
                *(_note(self.palette, note, places[0][0]) for note in record.notes),
            ],
            "margin": dict(theme.SIGNED_MARGIN_PX),
            "meta": {"panels": len(places)},
        }

    def _context(self) -> Iterator[Trace]:
        """What the flight is compared with, as far as it is known."""
        record, unit = self.record, self.record.output_unit
        yield _line("Set point", record.set_point, self.palette.dim, 1.5, "set point", None, "dot")
        if record.reference is not None:
            scored = scored_part(record.reference, record.set_point)
            yield _line("Reference", scored, self.palette.dim, 1.5, "reference", None, "dashdot")
        if record.best is not None:
            yield _line(f"Flight {record.best_number} · best", record.best, self.palette.best, 2, "best", unit)
        if record.predicted:
            yield _line(record.predicted_name, record.predicted, self.palette.prediction, 2, "prediction", unit, "dash")

    def _summary(self) -> str:
        record = self.record
        peak = int(np.argmax(record.curve.values))
        return (
            f"{record.output_title} of flight {record.number}: highest {record.curve.values[peak]:.2f} "
            f"{record.output_unit} at {record.curve.time_s[peak]:.1f} s."
        )

    def _table(self) -> Table:
        record, curve = self.record, self.record.curve
        named = (
            ("measured", "Measured", curve),
            ("set_point", "Set point", record.set_point),
            ("predicted", record.predicted_name, record.predicted or None),
        )
        channels = [
            (title.lower().replace(" ", "_"), title, channel)
            for panel in record.panels
            for title, channel in panel.curves.items()
        ]
        seconds = np.linspace(float(curve.time_s[0]), float(curve.time_s[-1]), TABLE_ROWS)
        return table_of_curves(seconds.tolist(), 2, record.output_unit, named, channels)


def _places(below: int) -> list[list[float]]:
    """Bottom and top of the output's panel and of each of those below it, as shares of the figure."""
    height = (1.0 - _GAP * below) / (_OUTPUT_SHARE + below)
    tops = [1.0, *(1.0 - _OUTPUT_SHARE * height - _GAP - index * (height + _GAP) for index in range(below))]
    return [[max(0.0, top - (height if index else _OUTPUT_SHARE * height)), top] for index, top in enumerate(tops)]


def _saturated(palette: theme.Palette, command: Curve, limits: Range) -> Iterator[Trace]:
    """Where the command is at a limit between the first and the last time that it is above the lower one, while the
    motors run; no trace if it never is."""
    is_above = command.values > limits.low
    runs = np.maximum.accumulate(is_above) & np.maximum.accumulate(is_above[::-1])[::-1]
    held = runs & ((command.values >= limits.high) | (command.values <= limits.low))
    if not held.any():
        return
    edges = np.flatnonzero(np.diff(np.concatenate(([False], held, [False])).astype(np.int8)))
    x: list[float | None] = []
    y: list[float | None] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        x += [round(float(command.time_s[at]), 3) for at in (first, end - 1)] + [None]
        y += [float(command.values[at]) for at in (first, end - 1)] + [None]
    yield scatter(
        "Saturated",
        (x[:-1], y[:-1]),
        role="saturated",
        mode="lines+markers",
        line=theme.line(palette.bad, 5),
        marker=theme.solid(palette.bad, size=5),
        showlegend=True,
    )


def _names(palette: theme.Palette, events: Sequence[FlightEvent], lasts_s: float) -> Iterator[dict[str, object]]:
    """The events' names along their lines: the first at the left of its line, the others at the right, over the curves.

    Each one that is near the one before it at the same side is below that.
    """
    below = 0
    for index, event in enumerate(events):
        if index == 0:
            beside: dict[str, object] = {"xanchor": "right"}
        else:
            is_near = index > 1 and event.time_s - events[index - 1].time_s < _NEAR * lasts_s
            below = below + 1 if is_near else 0
            beside = {"bgcolor": palette.surface, "yshift": -_NAME_PX * below}
        yield _along(event.time_s, event.name, palette.dim, **{"y": 1, "yanchor": "top", **beside})


def _note(palette: theme.Palette, note: FlightEvent, bottom: float) -> dict[str, object]:
    """The note along its line, upward from the bottom of the output's panel."""
    text = note.name if len(note.name) <= _NOTE_LETTERS else f"{note.name[: _NOTE_LETTERS - 1].rstrip()}…"
    return _along(
        note.time_s, literal(text), palette.prediction, y=bottom, yanchor="bottom", hovertext=literal(note.name)
    )


def _along(time_s: float, text: str, colour: str, **place: object) -> dict[str, object]:
    return theme.label(text, colour, **{"x": time_s, "yref": "paper", "textangle": -90, **place})


def _line(
    name: str, curve: Curve, colour: str, width: float, role: str, unit: str | None, dash: str = "solid"
) -> Trace:
    """A curve, with hover text in its `unit`, none if that is None."""
    style = theme.line(colour, width, dash)
    if unit is None:
        return scatter(name, thin_by_bends(curve), role=role, line=style)
    hover = f"{name}: %{{y:.3f}} {unit}".rstrip() + "<extra></extra>"
    return scatter(name, thinned(curve, POINTS), role=role, line=style, hovertemplate=hover)
