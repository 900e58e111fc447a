"""One flight: altitude with prediction, set point and reference, and the thrust below it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Final

import numpy as np

from app.figures import theme
from app.figures.base import Card, Column, Table, Trace, reading, ready, scatter, table_of_curves
from app.figures.data import Band, Curve, Range
from app.figures.overlays import band_traces, glitch_traces
from app.figures.scale import robust_span, thin_by_bends, thinned
from app.figures.theme import PALETTES, Palette, ThemeName

POINTS: Final = 1200
TABLE_ROWS: Final = 34


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRecordData:
    """One recorded flight.

    `inputs` are further channels by title (Thrust, Feed-forward, …), all in the unit named in `inputs_title`.
    """

    number: int
    output_title: str
    output_unit: str
    curve: Curve | None
    set_point: Curve
    reference: Curve | None = None
    predicted: Curve | None = None
    band: Band | None = None
    glitches: tuple[Range, ...] = ()
    best: Curve | None = None
    best_number: int | None = None
    inputs: Mapping[str, Curve] = field(default_factory=dict)
    inputs_title: str = "Thrust (of full)"


@dataclass(frozen=True, slots=True)
class FlightFigure:
    """Table columns: `time_s`, `measured`, `set_point`, `predicted` (if known), then the inputs by title."""

    record: FlightRecordData
    theme: ThemeName = "light"
    name: ClassVar[str] = "flight"
    title: ClassVar[str] = "Flight record"

    def not_ready(self) -> str | None:
        if self.record.curve is None or len(self.record.curve.time_s) == 0:
            return "There is no record of this flight yet."
        return None

    def compute(self) -> Card:
        palette, curve = PALETTES[self.theme], self.record.curve
        assert curve is not None
        inputs = [self._input(palette, index, title) for index, title in enumerate(self.record.inputs)]
        traces = [*self._outputs(palette, curve), *inputs]
        return ready(self, traces, self._layout(palette, curve), summary=self._summary(), table=self._table(curve))

    def _outputs(self, palette: Palette, curve: Curve) -> list[Trace]:
        """The flight with its context curves, and its glitches on top."""
        record = self.record
        return [
            *band_traces(palette, record.band),
            *self._context(palette),
            _line(f"Flight {record.number}", curve, palette.ink, 2.5, "flight", record.output_unit),
            *glitch_traces(palette, record.number, curve, record.glitches, record.output_unit),
        ]

    def _layout(self, palette: Palette, curve: Curve) -> dict[str, object]:
        """The output on top, the inputs below it if there are any."""
        record, goal = self.record, self.record.set_point
        low, high, _ = robust_span(
            [curve.values], low=min(0.0, float(goal.values.min())), high=max(0.0, float(goal.values.max()))
        )
        output = f"{record.output_title} ({record.output_unit})"
        place = [0.36, 1.0] if record.inputs else [0.0, 1.0]
        axes: dict[str, object] = {"yaxis": theme.titled(palette, output, domain=place, range=[low, high])}
        if record.inputs:
            axes["yaxis2"] = theme.titled(palette, record.inputs_title, domain=[0.0, 0.28], nticks=4)
        begin = float(curve.time_s[0]) - 0.01 * float(goal.time_s[-1])
        axes["xaxis"] = theme.titled(
            palette,
            "Time since the command (s)",
            anchor="y2" if record.inputs else "y",
            range=[begin, float(curve.time_s[-1])],
        )
        return theme.layout(palette, uirevision="flight", **axes)

    def _context(self, palette: Palette) -> list[Trace]:
        record, unit = self.record, self.record.output_unit
        drawn = [_line("Set point", record.set_point, palette.dim, 1.5, "set point", None, "dot")]
        if record.reference is not None:
            drawn.append(_line("Reference", record.reference, palette.dim, 1.5, "reference", None, "dashdot"))
        if record.best is not None:
            drawn.append(_line(f"Flight {record.best_number} · best", record.best, palette.best, 2, "best", unit))
        if record.predicted is not None:
            drawn.append(_line("Predicted", record.predicted, palette.prediction, 2, "prediction", unit, "dash"))
        return drawn

    def _input(self, palette: Palette, index: int, title: str) -> Trace:
        colour = (palette.ink, *palette.gains)[index % (1 + len(palette.gains))]
        dash = ("solid", "dash", "dot")[index % 3]
        return {
            **_line(title, self.record.inputs[title], colour, 1.5, "input", "", dash),
            "yaxis": "y2",
        }

    def _summary(self) -> str:
        record = self.record
        assert record.curve is not None
        peak = int(np.argmax(record.curve.values))
        return (
            f"{record.output_title} of flight {record.number}: highest {record.curve.values[peak]:.2f} "
            f"{record.output_unit} at {record.curve.time_s[peak]:.1f} s."
        )

    def _table(self, curve: Curve) -> Table:
        record = self.record
        named = [
            (Column("measured", "Measured", record.output_unit, 3), curve),
            (Column("set_point", "Set point", record.output_unit, 3), record.set_point),
        ]
        if record.predicted is not None:
            named.append((Column("predicted", "Predicted", record.output_unit, 3), record.predicted))
        named += [
            (Column(title.lower().replace(" ", "_"), title, "", 3), inputs) for title, inputs in record.inputs.items()
        ]
        seconds = np.linspace(float(curve.time_s[0]), float(curve.time_s[-1]), TABLE_ROWS)
        return table_of_curves(seconds.tolist(), 2, named)


def _line(
    name: str, curve: Curve, colour: str, width: float, role: str, unit: str | None, dash: str = "solid"
) -> Trace:
    """A curve, with hover text in its `unit`, none if that is None."""
    style = theme.line(colour, width, dash)
    if unit is None:
        return scatter(name, thin_by_bends(curve.time_s, curve.values), role=role, line=style)
    hover = reading(name, unit)
    return scatter(name, thinned(curve.time_s, curve.values, POINTS), role=role, line=style, hovertemplate=hover)
