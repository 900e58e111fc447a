"""Search for the gains with the least predicted error that keep the throttle's activity, and a margin from ringing:
damping of the loop's modes with more gain and more lag than the vehicle has."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from itertools import product
from typing import Final, TypeVar

import numpy as np

from app.core.analysis.loop import GainSpace, LinearLoop, LoggedFlight
from app.core.analysis.prediction import FlightModel
from app.core.models.copter import Copter
from app.core.records.trajectory import Samples

_V = TypeVar("_V")

RINGING_DAMPING: Final = 0.05
"""Damping ratio below which an oscillation counts as ringing: 11 periods until it has fallen to 3 %."""

EXTRA_LAG_S: Final = 0.03
REQUIRED_MARGIN: Final = 2.0
LARGEST_MARGIN: Final = 8.0

_FORGOTTEN: Final = 1e-3
_SLOWEST_OSCILLATION_RAD_S: Final = 0.5
_SCAN: Final = 13
_IN_RANGE: Final = (0.7, 1.0, 1.4, REQUIRED_MARGIN)


def gain_margin(loop: LinearLoop[_V], vehicle: _V) -> float:
    """Factor on the loop's fast gains at which it begins to ring with a vehicle `EXTRA_LAG_S` later.

    1 … `LARGEST_MARGIN`, or 0 if it rings with the gains as they are. All feedback passes through these gains, so it is
    also a factor on the vehicle's thrust slope over hover throttle.
    """
    damping = partial(_slower_damping, loop, vehicle)
    factors = np.geomspace(1.0, LARGEST_MARGIN, _SCAN).tolist()
    above = [damping(factor) - RINGING_DAMPING for factor in factors]
    ringing = next((place for place, value in enumerate(above) if value < 0.0), None)
    if ringing is None:
        return LARGEST_MARGIN
    if ringing == 0:
        return 0.0
    below, beyond = factors[ringing - 1 : ringing + 1]
    share = above[ringing - 1] / (above[ringing - 1] - above[ringing])
    return float(below * (beyond / below) ** share)


def damping_within_margin(loop: LinearLoop[_V], vehicle: _V) -> float:
    """Least damping ratio with 0.7 … `REQUIRED_MARGIN` times the loop's fast gains and a vehicle `EXTRA_LAG_S` later.
    Less gain counts too: a large integral gain beside a small proportional one rings when the gain falls."""
    return min(_slower_damping(loop, vehicle, factor) for factor in _IN_RANGE)


def robust_damping(loop: LinearLoop[_V], vehicles: Sequence[_V]) -> float:
    """Least damping ratio that decides on gains: of the first vehicle, which is the likeliest, within the margin; of
    the others that are likely, with `REQUIRED_MARGIN` times the loop's fast gains. Their lags differ already, so that
    none is added."""
    likeliest, *others = vehicles
    return min(
        damping_within_margin(loop, likeliest),
        *(least_damping(loop.with_fast_gains(factor), each) for each in others for factor in (1.0, REQUIRED_MARGIN)),
    )


def _slower_damping(loop: LinearLoop[_V], vehicle: _V, factor: float) -> float:
    return least_damping(loop.with_fast_gains(factor), vehicle, late_s=EXTRA_LAG_S)


def least_damping(loop: LinearLoop[_V], vehicle: _V, *, late_s: float = 0.0) -> float:
    """Damping ratio of the least damped oscillation about hover, with a vehicle that follows `late_s` later; negative
    if one grows, 1 if there is none."""
    modes = np.linalg.eigvals(loop.transition(vehicle, late_s=late_s))
    poles = np.log(modes[np.abs(modes) > _FORGOTTEN]) / loop.step_s
    oscillations = poles[np.abs(poles.imag) > _SLOWEST_OSCILLATION_RAD_S]
    return float(min(-oscillations.real / np.abs(oscillations), default=1.0))


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
