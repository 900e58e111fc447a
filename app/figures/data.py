"""Input of the figures: a campaign's flights as plain data; and its curves as they are drawn: thinned, with axis ranges
that are robust against outliers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import median_low
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from app.core.definition import Interval
from app.core.policy import Gain, Gains
from app.core.records.trajectory import Samples, select_bends, select_samples

Outcome = Literal["not yet reviewed", "valid", "aborted", "invalid", "lost"]
"""Label of a flight's outcome in figures."""


@dataclass(frozen=True, slots=True)
class Curve:
    """One line: seconds since the command, shape (n,), and values of the same shape."""

    time_s: Samples
    values: Samples

    def __len__(self) -> int:
        return len(self.time_s)

    def part(self, kept: NDArray[np.bool_] | NDArray[np.uint64] | slice) -> "Curve":
        """The samples that are `kept`."""
        return Curve(self.time_s[kept], self.values[kept])

    def at(self, time_s: float) -> float | None:
        """Linear interpolation; None outside the record."""
        if len(self) == 0 or not self.time_s[0] <= time_s <= self.time_s[-1]:
            return None
        return float(np.interp(time_s, self.time_s, self.values))


NO_CURVE: Final = Curve(np.empty(0), np.empty(0))
"""That of a flight without a record, or without a prediction."""


@dataclass(frozen=True, slots=True)
class Range:
    """From `low` to `high`, in the unit of the quantity it belongs to."""

    low: float
    high: float

    def slice_of(self, rising: Samples) -> tuple[int, int]:
        """First index and end of the part of `rising`, shape (n,), inside the range, plus one sample on each side."""
        first = max(0, int(np.searchsorted(rising, self.low, "left")) - 1)
        return first, min(len(rising), int(np.searchsorted(rising, self.high, "right")) + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """The predicted band of a flight: two curves at the same times."""

    lower: Curve
    upper: Curve


@dataclass(frozen=True, slots=True, kw_only=True)
class AnyFlight:
    """A trial that was flown, or is next: its output as flown, or as the model has it, with the prediction of its
    error in the experiment's error unit and the interval of that, None where there is none."""

    number: int
    gains: Gains
    curve: Curve = NO_CURVE
    predicted_error: float | None = None
    interval: Interval | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightData(AnyFlight):
    """One flown trial, with its error, None if there is none; `glitches` are the times, s, at which the record is not
    plausible."""

    outcome: Outcome
    error: float | None
    glitches: tuple[Range, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class NextFlight(AnyFlight):
    """The proposed next flight, with its predicted band, if there is one. A curve without an error is that of a model
    too uncertain to predict one."""

    band: Band | None = None

    @property
    def curve_name(self) -> str:
        return curve_name(predicts=self.predicted_error is not None)


def curve_name(*, predicts: bool) -> str:
    """Name of a model's curve: a prediction, or only the curve of a model that no flight has calibrated."""
    return "Predicted" if predicts else "Model, not calibrated"


@dataclass(frozen=True, slots=True)
class Repeats:
    """Several valid flights with the same gains: their numbers, and their mean error with its standard error."""

    numbers: tuple[int, ...]
    mean: float
    standard_error: float


@dataclass(frozen=True, slots=True)
class Noise:
    """Scatter of the errors.

    `sd` is that of a single flight, `repeats` are the repeated flights, `best_numbers` the flights of the gains with
    the best mean, `around_best` is the range in which another flight of them would lie with 90 % probability. Without
    repeats all of it is the prior's.
    """

    sd: float
    repeats: tuple[Repeats, ...] = ()
    around_best: Range | None = None
    best_numbers: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Scored:
    """A scored output, with its set point and the reference if there is one. `by_reference`: it is scored against the
    reference, not against the set point."""

    output_title: str
    output_unit: str
    set_point: Curve
    reference: Curve | None = None
    by_reference: bool = False

    @property
    def target(self) -> Curve:
        """What the output is scored against."""
        return self.reference if self.by_reference and self.reference is not None else self.set_point


@dataclass(frozen=True, kw_only=True)
class History(Scored):
    """A campaign's data for its figures.

    `stop_improvement` is the share of the best error by which a flight must be lower to count as an improvement, None
    if the stop rule has no such condition. `flights` are in the order of their numbers. `noise` is None while it is not
    known. `window` is the visible time range, s, which is drawn with more points; None for all. `chosen` is the number
    of a flight that is always drawn. `altitude_limit_m` is the height at which the vehicle's flight is aborted, None if
    there is no such limit.
    """

    error_unit: str
    gains: tuple[Gain, ...]
    flights: tuple[FlightData, ...]
    proposal: NextFlight | None = None
    stop_improvement: float | None = None
    noise: Noise | None = None
    curves_title: str = "Takeoff curves"
    window: Range | None = None
    chosen: int | None = None
    altitude_limit_m: float | None = None

    @cached_property
    def valid(self) -> tuple[FlightData, ...]:
        """Valid flights with an error: the candidates for the best."""
        return tuple(flight for flight in self.flights if flight.outcome == "valid" and flight.error is not None)

    @cached_property
    def best(self) -> FlightData | None:
        """The valid flight with the lowest error, the earliest of equals."""
        return min(self.valid, key=lambda flight: (flight.error, flight.number), default=None)

    @property
    def valid_errors(self) -> list[float]:
        """Errors of the valid flights, in their order."""
        return [flight.error for flight in self.valid if flight.error is not None]

    @property
    def is_best_of_best_gains(self) -> bool:
        """Whether the best flight has the gains with the best mean, as far as the scatter is known."""
        known = () if self.noise is None else self.noise.best_numbers
        return self.best is None or not known or self.best.number in known

    @property
    def next_flights(self) -> tuple[NextFlight, ...]:
        """The proposed flight, if there is one, to be joined to the flown ones."""
        return () if self.proposal is None else (self.proposal,)

    @property
    def last_number(self) -> int:
        """The highest flight number in a figure, including the proposed flight."""
        return max((flight.number for flight in (*self.flights, *self.next_flights)), default=1)

    def standing_of(self, flight: FlightData) -> str:
        """The standing of a flight among those of its campaign, which decides how its curve is drawn: `best`, `latest`,
        `baseline`, `earlier`, `invalid` or `unjudged`."""
        if flight.outcome == "not yet reviewed":
            return "unjudged"
        if flight.outcome != "valid":
            return "invalid"
        if flight is self.best:
            return "best"
        if flight is not self.flights[-1]:
            return "earlier"
        return "baseline" if len(self.flights) > 1 and flight.gains == self.flights[0].gains else "latest"


Points = tuple[list[float], list[float]]
"""Times and values to be drawn."""
MARGIN = 0.06
SMOOTH: Final = 1e-3
"""Allowed deviation of a drawn line from a smooth curve, as a share of its span: about a third of a pixel."""
SMOOTH_POINTS: Final = 1000
"""Number of samples among which the bends of a smooth curve are found."""


def robust_top(peaks: Sequence[float], *, low: float, high: float, spread: float = 5.0) -> tuple[float, list[int]]:
    """The upper end of an axis from `low` on that covers `high` and every peak that is not an outlier, and the indices
    of the outliers.

    A peak is an outlier if it exceeds `high` by more than half of the range `low` … `high`, and the (low) median of the
    peaks by more than `spread` times their median absolute deviation.
    """
    middle = median_low(peaks) if peaks else high
    deviation = median_low([abs(peak - middle) for peak in peaks]) if peaks else 0.0
    limit = max(high + 0.5 * (high - low), middle + spread * deviation)
    top = max([high, *(peak for peak in peaks if peak <= limit)])
    return top + MARGIN * (top - low), [index for index, peak in enumerate(peaks) if peak > limit]


RobustSpan = tuple[float, float, tuple[int, ...]]


def robust_span(curves: Sequence[Samples], *, low: float, high: float) -> RobustSpan:
    """A two-sided range for whole curves: low, high, and the curves that leave it on either side."""
    if not curves:
        curves = [np.array([low, high])]
    top, above = robust_top([float(values.max()) for values in curves], low=low, high=high)
    bottom, below = robust_top([-float(values.min()) for values in curves], low=-high, high=-low)
    return -bottom, top, tuple(sorted({*above, *below}))


def span_around(goal: Samples, curves: Sequence[Samples], *, headroom: float = 1.0) -> RobustSpan:
    """The range from the ground to the goal, with room above it, and of the curves around it; if the goal is zero, that
    of the first curve."""
    low, high = min(0.0, float(goal.min())), headroom * max(0.0, float(goal.max()))
    if low == high and curves:
        low, high = min(low, float(curves[0].min())), max(high, float(curves[0].max()))
    return robust_span(curves, low=low, high=high)


def thinned(curve: Curve, points: int, window: Range | None = None) -> Points:
    """At most `points` samples that preserve the curve's shape and extremes.

    Times are rounded to 0.1 ms, values to four decimals, or five if the curve stays below 1. With a `window` of
    seconds, as many again inside it, up to its edges and just past them.
    """
    chosen = select_samples(curve.time_s, curve.values, points)
    if window is not None:
        first, end = window.slice_of(curve.time_s)
        seen = curve.part(slice(first, end))
        inside = first + select_samples(seen.time_s, seen.values, points).astype(np.int64)
        chosen = np.concatenate([chosen[chosen < first], inside.astype(np.uint64), chosen[chosen >= end]])
    return _short(curve.part(chosen))


def thin_by_bends(curve: Curve) -> Points:
    """The samples at which a smooth curve bends, for a line without hover text."""
    near = curve.part(select_samples(curve.time_s, curve.values, SMOOTH_POINTS))
    tolerance = SMOOTH * float(np.ptp(near.values)) if near else 0.0
    return _short(near.part(select_bends(near.time_s, near.values, tolerance)))


def _short(curve: Curve) -> Points:
    digits = 4 if not curve or float(np.abs(curve.values).max()) >= 1.0 else 5
    return [round(t, 4) for t in curve.time_s.tolist()], [round(v, digits) for v in curve.values.tolist()]
