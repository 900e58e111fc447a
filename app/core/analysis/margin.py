"""How far the loop is from ringing: damping of its modes with more gain and more lag than the vehicle has."""

from collections.abc import Sequence
from functools import partial
from typing import Final, TypeVar

import numpy as np

from app.core.analysis.loop import LinearLoop

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
    modes = np.linalg.eigvals(loop.transition(vehicle, late_s=late_s)).astype(np.complex128)
    poles = np.log(modes[np.abs(modes) > _FORGOTTEN]) / loop.step_s
    oscillations = poles[np.abs(poles.imag) > _SLOWEST_OSCILLATION_RAD_S]
    return float(min(-oscillations.real / np.abs(oscillations), default=1.0))
