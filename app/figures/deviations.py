"""The panel below a flight's output: its deviation from a set point that is a step."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from app.figures import theme
from app.figures.base import Trace
from app.figures.data import Curve, FlightData, Range
from app.figures.overlays import Side, leaves_upward, off_scale, part_off_scale
from app.figures.theme import Palette

NEAR: Final = 0.05
"""Deviation at which the climb has ended, as a share of the set point; the range of the panel is not smaller."""
MOST: Final = 0.5
"""Largest deviation in the panel, as a share of the set point: the climb begins at a deviation of all of it."""
OPEN: Final = 0.2
"""The same before the first flight."""
ROOM: Final = 1.1
LABEL_S: Final = 1.2
"""Width of a label."""


def is_step(set_point: Curve) -> bool:
    """Whether the deviation is another curve than the output itself."""
    return float(set_point.values.max()) > 0.0


def deviation_of(curve: Curve, set_point: Curve) -> Curve:
    """Output − set point, from the command on."""
    flown = curve.time_s >= 0.0
    time_s = curve.time_s[flown]
    return Curve(time_s, curve.values[flown] - np.interp(time_s, set_point.time_s, set_point.values))


def after_climb(deviation: Curve, set_point: Curve) -> Curve:
    """The part of a deviation from the end of the climb to the end of the set point.

    The climb ends where the output is first within 5 % of the set point, or if it never is, nearest to it.
    """
    lasts = deviation.time_s <= set_point.time_s[-1]
    time_s, values = deviation.time_s[lasts], deviation.values[lasts]
    if len(values) == 0:
        return Curve(time_s, values)
    is_near = np.abs(values) <= NEAR * float(set_point.values.max())
    first = int(is_near.argmax() if is_near.any() else np.abs(values).argmin())
    return Curve(time_s[first:], values[first:])


def deviation_limit(curves: Sequence[Curve], set_point: Curve) -> float:
    """Limit of a symmetric axis that contains the deviation of these outputs after their climb, within bounds."""
    target = float(set_point.values.max())
    deviations = [after_climb(deviation_of(curve, set_point), set_point).values for curve in curves]
    peaks = [float(np.abs(values).max()) for values in deviations if len(values)]
    return min(MOST * target, max(NEAR * target, *peaks) * ROOM) if peaks else OPEN * target


def off_scale_deviations(
    palette: Palette, flights: Sequence[FlightData], set_point: Curve, limit: float, *, unit: str, opening_s: float
) -> list[Trace]:
    """Marks at the edge of the panel for flights that leave it after the climb, labelled where there is room.

    They are at the largest deviation until `opening_s`, or of the whole flight if it leaves the panel only later.
    """
    peaks = sorted(_peaks(flights, set_point, limit, opening_s), key=lambda peak: peak[:2])
    marks, taken = list[Trace](), dict[bool, list[Range]]()
    for time_s, number, deviation in peaks:
        labels = taken.setdefault(leaves_upward(deviation.values, -limit, limit), [])
        marks.append(
            off_scale(
                str(number),
                deviation,
                -limit,
                limit,
                palette.bad,
                role="off scale deviation",
                trial=number,
                text=f"Deviation of flight {number}",
                unit=unit,
                digits=2,
                side=_side(time_s, opening_s, labels),
                yaxis="y2",
            )
        )
    return marks


def _side(time_s: float, opening_s: float, labels: list[Range]) -> Side | None:
    """Where a mark's label fits into the chart and beside the `labels` at the same edge, to which it is added."""
    sides: dict[Side, float] = {"right": 0.0, "center": LABEL_S / 2, "left": LABEL_S}
    for side, before_s in sides.items():
        own = Range(time_s - before_s, time_s + (LABEL_S - before_s))
        is_inside = own.low >= 0.0 and own.high <= max(opening_s, time_s)
        if is_inside and all(own.high <= other.low or own.low >= other.high for other in labels):
            labels.append(own)
            return side
    return None


def _peaks(
    flights: Sequence[FlightData], set_point: Curve, limit: float, opening_s: float
) -> Iterator[tuple[float, int, Curve]]:
    """Time of the mark, number and deviation of each flight that leaves the panel."""
    for flight in flights:
        if flight.curve is None:
            continue
        settled = after_climb(deviation_of(flight.curve, set_point), set_point)
        part = part_off_scale(settled, -limit, limit, opening_s)
        if part is not None:
            yield float(part.time_s[np.abs(part.values).argmax()]), flight.number, part


def deviation_axis(palette: Palette, limit: float, unit: str, **more: object) -> dict[str, object]:
    """The ordinate of the panel, from −limit to limit."""
    return theme.titled(
        palette,
        f"Deviation ({unit})",
        range=[-limit, limit],
        nticks=5,
        zeroline=True,
        zerolinecolor=palette.dim,
        **more,
    )
