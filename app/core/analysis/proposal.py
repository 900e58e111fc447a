"""Search for the gains with the least predicted error that keep the margin and the throttle's activity."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import product
from typing import Final, TypeVar

import numpy as np

from app.core.analysis.loop import GainSpace, LinearLoop, LoggedFlight
from app.core.analysis.margin import RINGING_DAMPING, gain_margin, robust_damping
from app.core.analysis.prediction import FlightModel
from app.core.models.copter import Copter
from app.core.records.trajectory import Samples

LARGEST_ACTIVITY: Final = 1.5
"""Throttle activity allowed, relative to that with the gains of the flight."""

_MOST_FLIGHTS: Final = 150
_FIRST_STEP, _LAST_STEP = 0.3, 0.01
_PRICE_OF_ACTIVITY: Final = 0.05
"""Relative error that is as good as a relative throttle activity: 1 % of one for 20 % of the other."""
_AS_GOOD: Final = math.log(1.05)
_LATTICE: Final = 4
"""Values of each gain from which the search takes its start."""
_DIGITS: Final = 3
_DECIMALS: Final = 2
_ROUNDING: Final = 0.005

_Point = tuple[float, ...]
"""Coordinates of the gains in the loop's space."""

_V = TypeVar("_V")


def propose(
    flight: LoggedFlight, copters: Sequence[Copter], starts: Sequence[Mapping[str, float]]
) -> dict[str, float] | None:
    """Gains of the loop's space (`search`) that move the throttle little more than those of the flight; the first of
    `copters` is the likeliest."""
    model, loop = FlightModel(flight, copters[:1]), flight.loop
    return search(
        loop.space,
        starts,
        loop.gains,
        fly=lambda gains: model.fly(loop.with_gains(gains)),
        loop_of=loop.with_gains,
        vehicles=copters,
    )


def search(
    space: GainSpace,
    starts: Sequence[Mapping[str, float]],
    usual: Mapping[str, float],
    *,
    fly: Callable[[Mapping[str, float]], tuple[float, float]],
    loop_of: Callable[[Mapping[str, float]], LinearLoop[_V]],
    vehicles: Sequence[_V],
) -> dict[str, float] | None:
    """Gains of a space with three digits, searched for from the best allowed one of `starts`, its gentle set and a
    lattice; None if none is allowed. Of what is found and these starts, those within 5 % of the best error, the one
    with the largest margin.

    The first of `vehicles` is the likeliest: error, m, and throttle activity, which `fly` returns, and margin are its.
    Allowed are gains within the space with which no vehicle rings (`robust_damping`), and that move the throttle at
    most `LARGEST_ACTIVITY` times as much as the `usual` ones.
    """
    _, usual_activity = fly(usual)

    @cache
    def loop_at(point: _Point) -> LinearLoop[_V]:
        return loop_of(space.gains_at(np.array(point)))

    @cache
    def flown(point: _Point) -> tuple[float, float]:
        """Logarithms of the predicted error, and of the throttle activity relative to the usual one."""
        error_m, activity = fly(space.gains_at(np.array(point)))
        return math.log(error_m), math.log(activity / usual_activity)

    def cost(point: _Point) -> float:
        error, activity = flown(point)
        return error + _PRICE_OF_ACTIVITY * activity

    @cache
    def excess(point: _Point) -> tuple[float, ...]:
        """How far the point is beyond what is allowed: in damping, activity, and the order of gains; allowed if none is
        positive."""
        return (
            RINGING_DAMPING - robust_damping(loop_at(point), vehicles),
            flown(point)[1] - math.log(LARGEST_ACTIVITY),
            *space.disorder(np.array(point)),
        )

    def is_allowed(point: _Point) -> bool:
        """The damping, which takes longest, is looked at last."""
        return flown(point)[1] <= math.log(LARGEST_ACTIVITY) and max(excess(point)) <= 0.0

    def margin(point: _Point) -> float:
        return gain_margin(loop_at(point), vehicles[0])

    low, high = (space.coordinates({name: ends[end] for name, ends in space.bounds.items()}) for end in (0, 1))
    points = [tuple(space.coordinates(start).tolist()) for start in (*starts, space.gentle)]
    allowed = list(filter(is_allowed, points))
    start = next(filter(is_allowed, sorted([*allowed, *_lattice(low, high)], key=cost)), None)
    if start is None:
        return None

    found = _minimum(cost, excess, start, low, high)
    rounded = tuple(space.coordinates(_rounded(space, space.gains_at(np.array(found)))).tolist())
    candidates = [*filter(is_allowed, [rounded]), start, *allowed]
    least = min(map(cost, candidates))
    best = max((point for point in candidates if cost(point) <= least + _AS_GOOD), key=margin)
    return _rounded(space, space.gains_at(np.array(best)))


def _lattice(low: Samples, high: Samples) -> list[_Point]:
    """Points at equal distances between the ends, shape (k,) each, which may be equal."""
    ends = zip(low.tolist(), high.tolist(), strict=True)
    values = [sorted(set(np.linspace(*each, _LATTICE).tolist())) for each in ends]
    return list(product(*values))


def _minimum(
    cost: Callable[[_Point], float],
    excess: Callable[[_Point], tuple[float, ...]],
    start: _Point,
    low: Samples,
    high: Samples,
) -> _Point:
    """The least cost without excess, searched from `start` within the ends, shape (k,) each, which may be equal."""
    from scipy.optimize import Bounds, NonlinearConstraint, minimize

    free = high > low
    if not free.any():
        return start

    def whole(point: Samples) -> _Point:
        coordinates = low.copy()
        coordinates[free] = point
        return tuple(coordinates.tolist())

    def cost_at(point: Samples) -> float:
        return cost(whole(point))

    def excess_at(point: Samples) -> Samples:
        return np.array(excess(whole(point)))

    found = minimize(
        cost_at,
        np.array(start)[free],
        method="COBYQA",
        bounds=Bounds(low[free], high[free]),
        constraints=NonlinearConstraint(excess_at, -np.inf, -_ROUNDING),
        options={"maxfev": _MOST_FLIGHTS, "initial_tr_radius": _FIRST_STEP, "final_tr_radius": _LAST_STEP},
    )
    return whole(found.x)


def _rounded(space: GainSpace, gains: Mapping[str, float]) -> dict[str, float]:
    """Gains with three digits; those that may be 0, with two decimals."""
    return {
        name: round(value, _DECIMALS) if space.zero(name) else float(f"{value:.{_DIGITS}g}")
        for name, value in gains.items()
    }
