"""Search for the gains with the least predicted error that keep the margin and the throttle's activity."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Final

import numpy as np

from app.core.analysis.flight import LoggedFlight
from app.core.analysis.margin import RINGING_DAMPING, damping_within_margin, gain_margin
from app.core.analysis.prediction import FlightModel
from app.core.control.ardupilot_parameters import FIRMWARE_NAMES, Parameters
from app.core.models.copter import Copter
from app.core.records.trajectory import Samples

BOUNDS: Final[Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "PSC_POSZ_P": (1.0, 3.0),
        "PSC_VELZ_P": (1.0, 8.0),
        "PSC_ACCZ_P": (0.2, 1.5),
        "PSC_ACCZ_I": (0.2, 3.0),
    }
)
"""Gains that are proposed, and their documented ranges; an integral gain below 0.2 fails the arming check."""

_GENTLE: Final[Mapping[str, float]] = MappingProxyType(
    {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.2, "PSC_ACCZ_I": 0.2}
)

LARGEST_ACTIVITY: Final = 1.5
"""Throttle activity allowed, relative to that with the gains of the flight."""

_MOST_FLIGHTS: Final = 150
_FIRST_STEP, _LAST_STEP = 0.3, 0.01
_PRICE_OF_ACTIVITY: Final = 0.05
"""Relative error that is as good as a relative throttle activity: 1 % of one for 20 % of the other."""
_AS_GOOD: Final = math.log(1.05)
_ACTIVITY_SOUGHT: Final = 0.97 * LARGEST_ACTIVITY
"""The few copters of a search differ from all of them by up to 3 %."""
_DIGITS: Final = 3
_ROUNDING: Final = 0.005

_Point = tuple[float, ...]
"""Logarithms of the gains, in the order of `BOUNDS`."""


def with_gains(parameters: Parameters, gains: Mapping[str, float]) -> Parameters:
    """The parameters with other values of these gains, by the firmware's names."""
    return replace(parameters, **{FIRMWARE_NAMES[name][0]: value for name, value in gains.items()})


def propose(
    flight: LoggedFlight, copters: Sequence[Copter], starts: Sequence[Mapping[str, float]]
) -> dict[str, float] | None:
    """Gains of `BOUNDS` with three digits, searched for from the best allowed one of `starts` and a gentle set; None if
    none is allowed. Of what is found and the starts, those within 5 % of the best error, the one with the largest
    margin.

    Allowed are gains within `BOUNDS` with an acceleration controller's I of at least its P, that ring with none of the
    copters within the margin, and move the throttle at most `LARGEST_ACTIVITY` times as much as those of the flight.
    """
    from scipy.optimize import Bounds, NonlinearConstraint, minimize

    model = FlightModel(flight, copters)
    _, usual_activity = model.fly(flight.parameters)

    def parameters(point: _Point) -> Parameters:
        return with_gains(flight.parameters, dict(zip(BOUNDS, np.exp(point).tolist(), strict=True)))

    @cache
    def flown(point: _Point) -> tuple[float, float]:
        """Logarithms of the predicted error, and of the throttle activity relative to that of the flight."""
        error_m, activity = model.fly(parameters(point))
        return math.log(error_m), math.log(activity / usual_activity)

    def cost(point: _Point) -> float:
        error, activity = flown(point)
        return error + _PRICE_OF_ACTIVITY * activity

    @cache
    def excess(point: _Point) -> tuple[float, float, float]:
        """How far the point is beyond what is allowed: in damping, activity, and P over I; allowed if none is
        positive."""
        damping = min(
            damping_within_margin(parameters(point), each, filter_hz=flight.filter_hz, step_s=flight.step_s)
            for each in copters
        )
        gains = dict(zip(BOUNDS, point, strict=True))
        return (
            RINGING_DAMPING - damping,
            flown(point)[1] - math.log(_ACTIVITY_SOUGHT),
            gains["PSC_ACCZ_P"] - gains["PSC_ACCZ_I"],
        )

    def margin(point: _Point) -> float:
        return min(
            gain_margin(parameters(point), each, filter_hz=flight.filter_hz, step_s=flight.step_s) for each in copters
        )

    low, high = np.log(np.array(list(BOUNDS.values()))).T
    points = [
        tuple(np.clip(np.log([start[name] for name in BOUNDS]), low, high).tolist()) for start in (*starts, _GENTLE)
    ]
    allowed = [point for point in points if max(excess(point)) <= 0.0]
    if not allowed:
        return None

    def cost_at(point: Samples) -> float:
        return cost(tuple(point.tolist()))

    def excess_at(point: Samples) -> Samples:
        return np.array(excess(tuple(point.tolist())))

    found = minimize(
        cost_at,
        np.array(min(allowed, key=cost)),
        method="COBYQA",
        bounds=Bounds(low, high),
        constraints=NonlinearConstraint(excess_at, -np.inf, -_ROUNDING),
        options={"maxfev": _MOST_FLIGHTS, "initial_tr_radius": _FIRST_STEP, "final_tr_radius": _LAST_STEP},
    )
    rounded = tuple(math.log(float(f"{value:.{_DIGITS}g}")) for value in np.exp(found.x).tolist())
    candidates = [point for point in (rounded, *allowed) if max(excess(point)) <= 0.0]
    least = min(map(cost, candidates))
    best = max((point for point in candidates if cost(point) <= least + _AS_GOOD), key=margin)
    return {name: float(f"{math.exp(value):.{_DIGITS}g}") for name, value in zip(BOUNDS, best, strict=True)}
