"""The panel below a flight's output: its deviation from a set point that is not zero, or from the reference."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.figures import theme
from app.figures.base import Trace
from app.figures.data import Curve, FlightData, Range
from app.figures.overlays import Side, leaves_upward, off_scale, part_off_scale, signed

FINEST: Final = 0.005
"""The smallest range of the panel for steps, as a share of the set point."""
NEAR: Final = 0.05
"""Deviation at which the climb has ended, as a share of the set point; the range of the panel is not smaller."""
MOST: Final = 0.5
"""Largest deviation in the panel, as a share of the set point: the climb begins at a deviation of all of it."""
OPEN: Final = 0.2
"""The same before the first flight."""
ROOM: Final = 1.1
LABEL_SHARE: Final = 0.145
"""Width of a label, as a share of the visible time range."""
DIGITS: Final = 2
SHARED_DIGITS: Final = 1
"""Digits of a label that several flights share, which agree in these."""


def is_step(set_point: Curve) -> bool:
    """Whether the deviation is another curve than the output itself."""
    return float(set_point.values.max()) > 0.0


def changes_of(set_point: Curve) -> list[float]:
    """Times at which the set point changes, s; empty for a single step."""
    return [float(time_s) for time_s in set_point.time_s[1:][np.diff(set_point.values) != 0.0]]


def scored_part(curve: Curve, set_point: Curve) -> Curve:
    """The part of a curve from the first change of the set point on: steps are not scored before it. All of the curve
    for a single step."""
    changes_s = changes_of(set_point)
    return curve.part(curve.time_s >= changes_s[0]) if changes_s else curve


def deviation_of(curve: Curve, set_point: Curve) -> Curve:
    """Output − set point (or what else the output is scored against), from the command on."""
    flown = curve.part(curve.time_s >= 0.0)
    return Curve(flown.time_s, flown.values - np.interp(flown.time_s, set_point.time_s, set_point.values))


def after_climb(deviation: Curve, set_point: Curve) -> Curve:
    """The part of a deviation from the end of the climb to the end of the set point.

    The climb ends where the output is first within 5 % of the set point, or if it never is, nearest to it.
    """
    lasting = deviation.part(deviation.time_s <= set_point.time_s[-1])
    if not lasting:
        return lasting
    sizes = np.abs(lasting.values)
    is_near = sizes <= NEAR * float(set_point.values.max())
    return lasting.part(slice(int(is_near.argmax() if is_near.any() else sizes.argmin()), None))


def deviation_limit(curves: Sequence[Curve], set_point: Curve) -> float:
    """Limit of a symmetric axis that contains the deviation of these outputs after their climb, within bounds."""
    target = float(set_point.values.max())
    deviations = [after_climb(deviation_of(curve, set_point), set_point).values for curve in curves]
    peaks = [float(np.abs(values).max()) for values in deviations if len(values)]
    return min(MOST * target, max(NEAR * target, *peaks) * ROOM) if peaks else OPEN * target


def scored_deviation_limit(curve: Curve, target: Curve, set_point: Curve) -> float:
    """The same for a flight that is scored from the first change of the set point on: for what is scored."""
    if not changes_of(set_point):
        return deviation_limit([curve], set_point)
    highest, lasting = float(set_point.values.max()), curve.part(curve.time_s <= set_point.time_s[-1])
    scored = scored_part(deviation_of(lasting, target), set_point).values
    peak = float(np.abs(scored).max()) if len(scored) else OPEN * highest
    return min(MOST * highest, max(FINEST * highest, peak) * ROOM)


def off_scale_deviations(
    palette: theme.Palette, flights: Sequence[FlightData], set_point: Curve, limit: float, *, unit: str, window: Range
) -> list[Trace]:
    """Marks at the edge of the panel for flights that leave it after the climb, at their largest deviation in the
    visible time range `window`.

    They are labelled where there is room; one label names all flights at the same place with about the same
    deviation.
    """
    marks, labels = sorted(_marks(flights, set_point, limit, window), key=lambda mark: mark.time_s), list[_Label]()
    for mark in marks:
        _place(mark, [label for label in labels if label.mark.up == mark.up], labels, window)
    of_mark = {label.mark.number: label for label in labels}
    return [_trace(palette, mark, of_mark.get(mark.number), limit, unit) for mark in marks]


@dataclass(frozen=True, slots=True)
class _Mark:
    """A flight that leaves the panel: its visible deviation, with the largest one, roughly, and its time."""

    number: int
    deviation: Curve
    time_s: float
    peak: str
    up: bool


@dataclass(slots=True)
class _Label:
    """The label of a mark, which names the flights of `numbers`, with the time range that it covers."""

    mark: _Mark
    side: Side
    covers: Range
    numbers: list[int]


def _marks(flights: Sequence[FlightData], set_point: Curve, limit: float, window: Range) -> Iterator[_Mark]:
    """The mark of each flight that leaves the panel in the visible time range."""
    for flight in flights:
        part = part_off_scale(after_climb(deviation_of(flight.curve, set_point), set_point), -limit, limit, window)
        if part:
            place = int(np.abs(part.values).argmax())
            peak = signed(float(part.values[place]), SHARED_DIGITS)
            up = leaves_upward(part.values, -limit, limit)
            yield _Mark(flight.number, part, float(part.time_s[place]), peak, up)


def _place(mark: _Mark, beside: Sequence[_Label], labels: list[_Label], window: Range) -> None:
    """Add a label where it fits into the chart and between those `beside` it; else name the flight in one of them, if
    that has about the same deviation."""
    width = LABEL_SHARE * (window.high - window.low)
    sides: dict[Side, float] = {"right": 0.0, "center": width / 2, "left": width}
    for side, before_s in sides.items():
        covers = Range(mark.time_s - before_s, mark.time_s + (width - before_s))
        is_inside = covers.low >= max(0.0, window.low) and covers.high <= window.high
        if is_inside and not any(_overlaps(covers, label.covers) for label in beside):
            labels.append(_Label(mark, side, covers, [mark.number]))
            return
    around = Range(mark.time_s - width, mark.time_s + width)
    same = [label for label in beside if label.mark.peak == mark.peak and _overlaps(around, label.covers)]
    if same:
        same[-1].numbers.append(mark.number)


def _overlaps(one: Range, other: Range) -> bool:
    return one.low < other.high and other.low < one.high


def _trace(palette: theme.Palette, mark: _Mark, label: _Label | None, limit: float, unit: str) -> Trace:
    return off_scale(
        "" if label is None else ", ".join(map(str, sorted(label.numbers))),
        mark.deviation,
        -limit,
        limit,
        palette.bad,
        role="off scale deviation",
        trial=mark.number,
        text=f"Deviation of flight {mark.number}",
        unit=unit,
        digits=SHARED_DIGITS if label is not None and len(label.numbers) > 1 else DIGITS,
        side="center" if label is None else label.side,
        yaxis="y2",
    )


def deviation_axis(palette: theme.Palette, limit: float, unit: str, **more: object) -> dict[str, object]:
    """The ordinate of the panel, from −limit to limit."""
    return palette.axis(
        f"Deviation ({unit})",
        range=[-limit, limit],
        nticks=5,
        zeroline=True,
        zerolinecolor=palette.dim,
        **more,
    )
