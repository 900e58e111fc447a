"""PX4's estimator of the hover thrust: a Kalman filter of one state, updated by the vertical acceleration."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.autopilots.px4.replica.parameters import hover_limits
from app.core.kernels import kernel
from app.core.models.copter import GRAVITY_M_S2
from app.core.records.trajectory import Samples

# Indices in the state array.
THRUST: Final = 0
_VARIANCE: Final = 1
_NOISE_VARIANCE: Final = 2
_MEAN_INNOVATION: Final = 3
_MEAN_RATIO: Final = 4
_STEADY_S: Final = 5
STATE_SIZE: Final = 6

_FIRST_NOISE_VARIANCE: Final = 5.0
_NOISE_S: Final = 2.0
_INNOVATION_S: Final = 1.0
_BIASED_ABOVE: Final = 0.2
_FORGETTING: Final = 1000.0
_VALID_BELOW: Final = 0.001
_VALID_AFTER_S: Final = 2.0
_LEAST_THRUST: Final = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class HoverSettings:
    """MPC_THR_HOVER, and HTE_HT_ERR_INIT, HTE_HT_NOISE, HTE_ACC_GATE, HTE_THR_RANGE and HTE_VZ_THR."""

    hover_thrust: float
    initial_error: float
    noise_1_s: float
    gate: float
    range: float
    fast_m_s: float

    def start(self) -> Samples:
        """Return the state while disarmed, shape (STATE_SIZE,): MPC_THR_HOVER."""
        state = np.zeros(STATE_SIZE)
        state[THRUST] = self.hover_thrust
        state[_VARIANCE], state[_NOISE_VARIANCE] = self.initial_error**2, _FIRST_NOISE_VARIANCE
        return state

    def packed(self) -> Samples:
        """Return the constants for `update`, shape (5,)."""
        low, highest = hover_limits(self.hover_thrust, self.range)
        lowest = max(low, _LEAST_THRUST)
        return np.array([self.noise_1_s, self.gate, lowest, highest, self.fast_m_s])


@kernel
def update(state: Samples, settings: Samples, a: float, thrust: float, climb: float, dt: float) -> float:
    """Advance by `dt`, s, with the acceleration `a`, m/s² up, under `thrust`, a share of full, at the climb rate
    `climb`, m/s; return the estimate, or NaN until it is valid. `settings` are packed."""
    grown = (settings[0] * dt) ** 2
    hover, variance = state[THRUST], state[_VARIANCE] + grown
    slope = -GRAVITY_M_S2 * thrust / (hover * hover)
    noise = state[_NOISE_VARIANCE] * max(1.0, abs(climb) - settings[4] + 1.0) ** 2
    total = slope * slope * variance + noise
    innovation = a - GRAVITY_M_S2 * (thrust / hover - 1.0)
    ratio = innovation * innovation / (settings[1] * settings[1] * total)
    if ratio < 1.0:
        gain = variance * slope / total
        hover = min(max(hover + gain * innovation, settings[2]), settings[3])
        variance = min(max((1.0 - gain * slope) * variance, 1e-10), 1.0)
        innovation = a - GRAVITY_M_S2 * (thrust / hover - 1.0)
    elif abs(state[_MEAN_RATIO]) > _BIASED_ABOVE:
        variance += _FORGETTING * grown
    state[THRUST], state[_VARIANCE] = hover, variance
    share = dt / (_INNOVATION_S + dt)
    state[_MEAN_RATIO] += share * (math.copysign(min(ratio, 1.0), innovation) - state[_MEAN_RATIO])
    state[_MEAN_INNOVATION] += share * (innovation - state[_MEAN_INNOVATION])
    scatter = (innovation - state[_MEAN_INNOVATION]) ** 2 + slope * slope * variance
    noise_variance = state[_NOISE_VARIANCE] + dt / (_NOISE_S + dt) * (scatter - state[_NOISE_VARIANCE])
    state[_NOISE_VARIANCE] = min(max(noise_variance, 1.0), 400.0)
    was_valid = state[_STEADY_S] >= _VALID_AFTER_S
    is_steady = variance < _VALID_BELOW and (ratio < 1.0 or was_valid)
    state[_STEADY_S] = state[_STEADY_S] + dt if is_steady else 0.0
    estimate: float = hover if state[_STEADY_S] >= _VALID_AFTER_S else math.nan
    return estimate
