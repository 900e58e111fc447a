"""PX4's estimator of the hover thrust: a Kalman filter of one state, updated by the vertical acceleration."""

import math
from dataclasses import dataclass
from typing import Final

from app.core.models.copter import GRAVITY_M_S2

_NOISE_VARIANCE: Final = 5.0
_NOISE_RANGE: Final = (1.0, 400.0)
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

    hover_thrust: float = 0.5
    initial_error: float = 0.1
    noise_1_s: float = 0.0036
    gate: float = 3.0
    range: float = 0.2
    fast_m_s: float = 2.0

    def limited(self, thrust: float) -> float:
        """Limit an estimate to its range about MPC_THR_HOVER."""
        lowest = min(max(self.hover_thrust - self.range, 0.0), 0.8)
        highest = min(max(self.hover_thrust + self.range, 0.2), 0.9)
        return min(max(thrust, lowest, _LEAST_THRUST), highest)


class HoverThrustEstimator:
    """Estimate of the thrust in hover, a share of full thrust."""

    def __init__(self, settings: HoverSettings) -> None:
        self.reset(settings)

    def reset(self, settings: HoverSettings) -> None:
        """Begin with MPC_THR_HOVER, as while disarmed."""
        self.thrust = settings.limited(settings.hover_thrust)
        self._variance = settings.initial_error**2
        self._noise_variance = _NOISE_VARIANCE
        self._mean_innovation = self._mean_ratio = self._steady_s = 0.0

    def update(
        self, settings: HoverSettings, *, acceleration_m_s2: float, thrust: float, climb_m_s: float, dt_s: float
    ) -> float:
        """Advance by `dt_s` with the acceleration, up, under `thrust`; return it, or NaN until it is valid."""
        grown = (settings.noise_1_s * dt_s) ** 2
        self._variance += grown
        slope = -GRAVITY_M_S2 * thrust / self.thrust**2
        noise = self._noise_variance * max(1.0, abs(climb_m_s) - settings.fast_m_s + 1.0) ** 2
        total = max(slope**2 * self._variance + noise, noise)
        innovation = self._innovation(acceleration_m_s2, thrust)
        ratio = innovation**2 / (settings.gate**2 * total)
        if ratio < 1.0:
            gain = self._variance * slope / total
            self.thrust = settings.limited(self.thrust + gain * innovation)
            self._variance = min(max((1.0 - gain * slope) * self._variance, 1e-10), 1.0)
            innovation = self._innovation(acceleration_m_s2, thrust)
        elif abs(self._mean_ratio) > _BIASED_ABOVE:
            self._variance += _FORGETTING * grown
        share = dt_s / (_INNOVATION_S + dt_s)
        self._mean_ratio += share * (math.copysign(min(ratio, 1.0), innovation) - self._mean_ratio)
        self._mean_innovation += share * (innovation - self._mean_innovation)
        scatter = (innovation - self._mean_innovation) ** 2 + slope**2 * self._variance
        noise_variance = self._noise_variance + dt_s / (_NOISE_S + dt_s) * (scatter - self._noise_variance)
        self._noise_variance = min(max(noise_variance, _NOISE_RANGE[0]), _NOISE_RANGE[1])
        is_steady = self._variance < _VALID_BELOW and (ratio < 1.0 or self._steady_s >= _VALID_AFTER_S)
        self._steady_s = self._steady_s + dt_s if is_steady else 0.0
        return self.thrust if self._steady_s >= _VALID_AFTER_S else math.nan

    def _innovation(self, acceleration_m_s2: float, thrust: float) -> float:
        return acceleration_m_s2 - GRAVITY_M_S2 * (thrust / self.thrust - 1.0)
