"""Shapes of failure in a flight of any loop: what a person would see in its curves, told by numbers with units.

Each shape is a function and a row of `_FINDERS`. None needs a model of the loop: only that throttle accelerates, and
that an estimate cannot move faster than its vehicle.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.analysis.description import LONGEST_GAP_S, Description, FlightSignals
from app.core.models.copter import GRAVITY_M_S2
from app.core.records.trajectory import Samples


class FailureShape(StrEnum):
    """A way in which an altitude, or what it is controlled with, goes wrong."""

    RINGING = "ringing"
    WINDUP = "windup"
    HOVER_THROTTLE = "hover_throttle"
    SATURATED_CLIMB = "saturated_climb"
    ESTIMATOR_JUMP = "estimator_jump"
    VIBRATION = "vibration"
    WIND = "wind"


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundShape:
    """A shape in a flight: its numbers, by names that end in their unit (1, a share or number, if in none), and since
    when it is seen, s of the recording."""

    shape: FailureShape
    numbers: Mapping[str, float]
    since_s: float


LEAST_RINGING_M: Final = 0.04
"""Amplitude: estimates of the altitude wander by as much."""
LEAST_OVERSHOOT_M: Final = 0.25
"""A takeoff with a sound integral exceeds its reference by less."""
AFTER_LIFT_OFF_S: Final = 10.0
"""Within this an integral that wound on the ground has done its harm in the air."""
LEAST_OVERSHOT_S: Final = 0.8
"""Above half of the overshoot: a gust lifts for less."""
REPEATED: Final = 0.6
"""A later deviation with this share of the overshoot tells that something else than the takeoff causes both."""
FALLS_M: Final = 0.15
"""Further below its highest so far a reference comes down: shaped ones exceed their target by less."""
LARGEST_HOVER_DIFFERENCE: Final = 0.1
"""Of the parameter: what a battery does to the hover throttle is less. The analysis of the whole log advises from it
on, too."""
SCATTERS: Final = 2.0
"""Standard deviations of the throttle at rest within which it may be another one's."""
AT_LIMIT: Final = 0.99
"""Of full throttle: a filtered one only comes near it."""
LEAST_SATURATED_S: Final = 0.8
"""A step of the set point takes the throttle to its limit for less. How far the altitude falls behind in it does not
matter: the reference of some loops waits for a vehicle at its limit."""
MOVES_M_S: Final = 0.1
"""Slower references stand still: shaped ones approach their target so."""
LARGEST_ACCELERATION_M_S2: Final = 20.0
"""Of any copter, up or down: twice its weight."""
LEAST_JUMP_M: Final = 0.25
LEAST_JUMP_M_S: Final = 0.5
"""Above what noise and rounding of altitude and climb rate do from row to row."""
LONGEST_ROW_S: Final = 0.3
"""Rows further apart tell no jump and no noise."""
LEAST_NOISE_M_S2: Final = 1.5
"""Standard deviation: twice that of PX4's own simulated sensor, whose acceleration is a mean over 8 ms. Behind
ArduCopter's filter of 20 Hz it is shaking of 40 m/s² at 100 Hz, where its documents begin to warn."""
LEAST_DISTURBANCE_M_S2: Final = 0.45
"""Standard deviation of the mean over a second: gusts of 0.3 m/s² have less, and the analysis takes them in its
stride."""
NOT_FOLLOWED: Final = 0.5
"""A disturbance of less than this share of the accelerations may be the thrust's curve and lag."""
_MEAN_OVER_S: Final = 1.0
_STEADY_S: Final = (-1.0, 0.5)
_LEAST_S: Final = 5.0
"""Of hover or flight, for a standard deviation."""
_OF_MEDIAN: Final = 1.4826
"""Standard deviation of normal noise over the median of its size, which single shocks do not change."""

_Numbers = tuple[float, Mapping[str, float]] | None
"""Since when, s, and the numbers; None for a shape that is not there."""


def find_shapes(signals: FlightSignals, description: Description | None) -> Sequence[FoundShape]:
    """The shapes in a flight with this description, in the order of `FailureShape`; none if nothing flew."""
    if description is None:
        return ()
    tried = ((shape, find(signals, description)) for shape, find in _FINDERS.items())
    found = {shape: numbers for shape, numbers in tried if numbers is not None}
    explained = frozenset().union(*(_IMITATES.get(shape, ()) for shape in found))
    return [
        FoundShape(shape=shape, numbers=numbers, since_s=since_s)
        for shape, (since_s, numbers) in found.items()
        if shape not in explained
    ]


def _ringing(_: FlightSignals, description: Description) -> _Numbers:
    """A line in the spectrum of the deviation, of more than the estimate's own wandering."""
    line = description.oscillation
    if line is None or line.amplitude_m < LEAST_RINGING_M:
        return None
    return line.since_s, {"frequency_hz": line.frequency_hz, "amplitude_m": line.amplitude_m}


def _windup(signals: FlightSignals, _: Description) -> _Numbers:
    """After the first lift-off and before the reference comes down the altitude exceeds it for long, and does not
    deviate so afterwards."""
    lifted = np.flatnonzero(signals.flown[1:] & ~signals.flown[:-1]) + 1
    above_m = signals.altitude_m - signals.reference_m
    rows = np.flatnonzero(signals.flown & np.isfinite(above_m))
    rows = rows[rows >= lifted[0]] if lifted.size else lifted
    if not rows.size:
        return None
    since_s, above_m, reference_m = (
        signals.time_s[rows] - signals.time_s[lifted[0]],
        above_m[rows],
        signals.reference_m[rows],
    )
    comes_down = np.logical_or.accumulate(reference_m < np.maximum.accumulate(reference_m) - FALLS_M)
    early = (since_s < AFTER_LIFT_OFF_S) & ~comes_down
    overshoot_m = float(np.max(above_m[early], initial=0.0))
    lasts_s = float(_seconds(since_s)[early & (above_m > 0.5 * overshoot_m)].sum())
    later_m = float(np.max(np.abs(above_m[since_s >= AFTER_LIFT_OFF_S]), initial=0.0))
    if overshoot_m < LEAST_OVERSHOOT_M or lasts_s < LEAST_OVERSHOT_S or later_m > REPEATED * overshoot_m:
        return None
    return float(signals.time_s[lifted[0]]), {"overshoot_m": overshoot_m, "lasts_s": lasts_s}


def _hover_throttle(signals: FlightSignals, description: Description) -> _Numbers:
    """The throttle at rest is another one than the parameter for it."""
    assumed, hover, scatter = signals.assumed_hover, description.hover_throttle, description.hover_throttle_deviation
    if assumed is None or hover is None or scatter is None:
        return None
    if abs(hover - assumed) <= max(LARGEST_HOVER_DIFFERENCE * assumed, SCATTERS * scatter):
        return None
    return _begin_s(signals), {"hover_throttle_1": hover, "assumed_1": assumed}


def _saturated_climb(signals: FlightSignals, _: Description) -> _Numbers:
    """The throttle stays at its upper limit while the reference rises, and the altitude falls behind or the reference
    waits. The numbers are those of the longest time."""
    behind_m, longest, found = signals.reference_m - signals.altitude_m, LEAST_SATURATED_S, None
    for run in _runs(signals.held & np.isfinite(behind_m) & (signals.throttle >= AT_LIMIT)):
        lasts_s, rises_m = (float(each[run][-1] - each[run][0]) for each in (signals.time_s, signals.reference_m))
        if lasts_s >= longest and rises_m >= MOVES_M_S * lasts_s:
            longest, largest_m = lasts_s, max(float(behind_m[run].max()), 0.0)
            found = float(signals.time_s[run][0]), {"at_limit_s": lasts_s, "behind_m": largest_m}
    return found


def _estimator_jump(signals: FlightSignals, _: Description) -> _Numbers:
    """From one row to the next the altitude changes otherwise than its rate, or the rate by more than any thrust can.
    The numbers are those of the largest."""
    rates, between_s = signals.climb_rate_m_s, np.diff(signals.time_s)
    jumps_m = np.diff(signals.altitude_m) - 0.5 * (rates[1:] + rates[:-1]) * between_s
    jumps_m_s = np.diff(rates)
    can_move_m_s = LARGEST_ACCELERATION_M_S2 * between_s
    jumped = (np.abs(jumps_m) > LEAST_JUMP_M + 0.5 * can_move_m_s * between_s) | (
        np.abs(jumps_m_s) > LEAST_JUMP_M_S + can_move_m_s
    )
    flown = signals.flown[1:] & signals.flown[:-1] & (between_s <= LONGEST_ROW_S)
    places = np.flatnonzero(flown & jumped)
    if not places.size:
        return None
    largest = places[np.argmax(np.abs(jumps_m[places]))]
    numbers = {"altitude_m": float(jumps_m[largest]), "climb_rate_m_s": float(jumps_m_s[largest])}
    return float(signals.time_s[places[0] + 1]), {**numbers, "jumps_1": float(places.size)}


def _vibration(signals: FlightSignals, _: Description) -> _Numbers:
    """Noise of the sensed acceleration. A gust lasts longer than a row, and what the estimate does is not sensed: the
    noise is what differs both from the rows beside and from the change of the climb rate."""
    sensed, between_s = signals.sensed_m_s2, np.diff(signals.time_s)
    uneven = np.sqrt(2.0 / 3.0) * (sensed[1:-1] - 0.5 * (sensed[2:] + sensed[:-2]))
    unmoved = np.sqrt(2.0) * (0.5 * (sensed[1:] + sensed[:-1]) - np.diff(signals.climb_rate_m_s) / between_s)[1:]
    near = np.maximum(between_s[1:], between_s[:-1]) <= LONGEST_ROW_S
    known = signals.flown[2:] & signals.flown[:-2] & near & np.isfinite(uneven + unmoved)
    if between_s[1:][known].sum() < _LEAST_S:
        return None
    noise_m_s2 = min(_OF_MEDIAN * float(np.median(np.abs(each[known]))) for each in (uneven, unmoved))
    return (_begin_s(signals), {"noise_m_s2": noise_m_s2}) if noise_m_s2 >= LEAST_NOISE_M_S2 else None


def _wind(signals: FlightSignals, description: Description) -> _Numbers:
    """In hover, the acceleration that the mean throttle over a second does not explain."""
    known = np.isfinite(signals.climb_rate_m_s + signals.throttle)
    if not description.hover_throttle or not known.any():
        return None
    throttle, moved = _over_a_second(signals, known)
    pushed = moved - GRAVITY_M_S2 * (throttle / description.hover_throttle - 1.0)
    hovers = signals.held & _is_steady(signals) & np.isfinite(pushed)
    if _seconds(signals.time_s)[hovers].sum() < _LEAST_S:
        return None
    disturbance_m_s2, acceleration_m_s2 = (float(np.std(each[hovers])) for each in (pushed, moved))
    if disturbance_m_s2 < max(LEAST_DISTURBANCE_M_S2, NOT_FOLLOWED * acceleration_m_s2):
        return None
    return float(signals.time_s[hovers][0]), {"disturbance_m_s2": disturbance_m_s2}


_FINDERS: Final[Mapping[FailureShape, Callable[[FlightSignals, Description], _Numbers]]] = {
    FailureShape.RINGING: _ringing,
    FailureShape.WINDUP: _windup,
    FailureShape.HOVER_THROTTLE: _hover_throttle,
    FailureShape.SATURATED_CLIMB: _saturated_climb,
    FailureShape.ESTIMATOR_JUMP: _estimator_jump,
    FailureShape.VIBRATION: _vibration,
    FailureShape.WIND: _wind,
}
_IMITATES: Final[Mapping[FailureShape, frozenset[FailureShape]]] = {
    FailureShape.RINGING: frozenset({FailureShape.HOVER_THROTTLE, FailureShape.VIBRATION, FailureShape.WIND}),
    FailureShape.VIBRATION: frozenset({FailureShape.WIND}),
}
"""What a shape makes look like others, which then are not told: a vehicle that rings is never at rest, and an estimate
that vibration drives moves the throttle as wind does."""


def _begin_s(signals: FlightSignals) -> float:
    """When it begins to fly."""
    return float(signals.time_s[np.argmax(signals.flown)])


def _seconds(time_s: Samples) -> Samples:
    """What each row lasts, shape (n,), but for gaps."""
    return np.minimum(np.diff(time_s, append=time_s[-1:]), LONGEST_GAP_S)


def _runs(rows: NDArray[np.bool_]) -> Iterator[slice]:
    """Rows, shape (n,), that follow each other."""
    edges = np.flatnonzero(np.diff(rows.astype(np.int8), prepend=0, append=0))
    return (slice(*each) for each in edges.reshape(-1, 2).tolist())


def _over_a_second(signals: FlightSignals, known: NDArray[np.bool_]) -> tuple[Samples, Samples]:
    """Mean throttle over a second about each row, and mean acceleration in it, shape (n,) each, by the rows in which
    both are `known`; NaN where these do not reach that far."""
    at_s, throttle, rates = (each[known] for each in (signals.time_s, signals.throttle, signals.climb_rate_m_s))
    summed = np.append(0.0, np.cumsum(0.5 * (throttle[1:] + throttle[:-1]) * np.diff(at_s)))
    before_s, after_s = (signals.time_s + side * 0.5 * _MEAN_OVER_S for side in (-1.0, 1.0))
    mean, change = (
        (np.interp(after_s, at_s, each, right=np.nan) - np.interp(before_s, at_s, each, left=np.nan)) / _MEAN_OVER_S
        for each in (summed, rates)
    )
    return mean, change


def _is_steady(signals: FlightSignals) -> NDArray[np.bool_]:
    """Rows, shape (n,), about which the reference stands still."""
    time_s, reference_m = signals.time_s, signals.reference_m
    stands = np.abs(np.diff(reference_m)) < MOVES_M_S * np.diff(time_s)
    moved = np.concatenate([[0], np.cumsum(~stands)])
    first, last = (np.searchsorted(time_s, time_s + side_s) for side_s in _STEADY_S)
    return np.asarray(moved[np.minimum(last, len(time_s) - 1)] == moved[first])
