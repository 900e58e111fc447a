"""How far the loop is from ringing: damping of its modes with more gain and more lag than the vehicle has."""

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from app.core.control import ardupilot as loop
from app.core.control.ardupilot_parameters import HOVER, Packed, Parameters
from app.core.models.copter import (
    BODY_SIZE,
    DISTURBANCES,
    HOVER_THROTTLE,
    REFERENCE,
    Copter,
    start_body,
    step,
)
from app.core.records.trajectory import Samples

RINGING_DAMPING: Final = 0.05
"""Damping ratio below which an oscillation counts as ringing: 11 periods until it has fallen to 3 %."""

EXTRA_LAG_S: Final = 0.03
REQUIRED_MARGIN: Final = 2.0
LARGEST_MARGIN: Final = 8.0

_DYNAMIC: Final = [
    loop.THROTTLE,
    loop.THROTTLE_FILTERED,
    loop.VELOCITY_ERROR,
    loop.VELOCITY_DERIVATIVE,
    loop.VELOCITY_SUM,
    loop.FILTERED_TARGET,
    loop.ACCELERATION_ERROR,
    loop.ACCELERATION_DERIVATIVE,
    loop.ACCELERATION_SUM,
]
"""What the loop remembers from one step to the next, on a reference at rest."""

_NUDGE: Final = 1e-5
_FORGOTTEN: Final = 1e-3
_SLOWEST_OSCILLATION_RAD_S: Final = 0.5
_SCAN: Final = 13
_IN_RANGE: Final = (0.7, 1.0, 1.4, REQUIRED_MARGIN)


def gain_margin(parameters: Parameters, copter: Copter, *, filter_hz: float, step_s: float) -> float:
    """Factor on the acceleration controller's gains at which the loop begins to ring, with `EXTRA_LAG_S` more lag.

    1 … `LARGEST_MARGIN`, or 0 if it rings with the gains as they are. All feedback passes through this controller, so
    it is also a factor on the vehicle's thrust slope over hover throttle.
    """
    damping = partial(_slower_damping, parameters, copter, filter_hz=filter_hz, step_s=step_s)
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


def damping_within_margin(parameters: Parameters, copter: Copter, *, filter_hz: float, step_s: float) -> float:
    """Least damping ratio with 0.7 … `REQUIRED_MARGIN` times the gains of the acceleration controller and `EXTRA_LAG_S`
    more lag. Less gain counts too: a large integral gain beside a small proportional one rings when the gain falls."""
    damping = partial(_slower_damping, parameters, copter, filter_hz=filter_hz, step_s=step_s)
    return min(damping(factor) for factor in _IN_RANGE)


def _slower_damping(parameters: Parameters, copter: Copter, factor: float, *, filter_hz: float, step_s: float) -> float:
    scaled = replace(
        parameters,
        acceleration_p=factor * parameters.acceleration_p,
        acceleration_i_1_s=factor * parameters.acceleration_i_1_s,
        acceleration_d_s=factor * parameters.acceleration_d_s,
        acceleration_ff=factor * parameters.acceleration_ff,
    )
    slower = replace(copter, motor_lag_s=copter.motor_lag_s + EXTRA_LAG_S)
    return least_damping(scaled, slower, filter_hz=filter_hz, step_s=step_s)


def least_damping(parameters: Parameters, copter: Copter, *, filter_hz: float, step_s: float) -> float:
    """Damping ratio of the least damped oscillation about hover; negative if one grows."""
    modes = np.linalg.eigvals(_transition(parameters.packed(step_s), copter.packed(filter_hz=filter_hz, dt_s=step_s)))
    poles = np.log(modes[np.abs(modes) > _FORGOTTEN]) / step_s
    oscillations = poles[np.abs(poles.imag) > _SLOWEST_OSCILLATION_RAD_S]
    return float(min(-oscillations.real / np.abs(oscillations)))


def _transition(p: Packed, copter: Samples) -> Samples:
    """Derivative of the state after a step in hover with respect to that before, shape (k, k), by central
    differences of the step itself."""
    size = len(_DYNAMIC) + BODY_SIZE
    columns = [
        (_after_step(p, copter, nudge) - _after_step(p, copter, -nudge)) / (2.0 * _NUDGE)
        for nudge in _NUDGE * np.eye(size)
    ]
    return np.column_stack(columns)


def _after_step(p: Packed, copter: Samples, nudge: Samples) -> Samples:
    hover = float(copter[HOVER_THROTTLE])
    state = np.empty(loop.STATE_SIZE)
    loop.start_hover(state, p, hover, 0.0, 0.0, 0.0)
    state[loop.RESET] = 0.0
    state[loop.ACCELERATION_SUM] = 1000.0 * (hover - p[HOVER])
    state[_DYNAMIC] += nudge[: len(_DYNAMIC)]
    body = start_body(hover, 0.0, 0.0, 0.0, copter) + nudge[len(_DYNAMIC) :]
    step(state, body, p, copter, np.zeros(len(REFERENCE)), np.zeros(len(DISTURBANCES)))
    return np.concatenate([state[_DYNAMIC], body])
