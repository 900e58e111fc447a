"""The vertical guidance about hover, as a margin takes it: linear, on the model of `app.core.models.vertical`."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from app.core.analysis.loop import MarginTexts
from app.core.control.vertical_guidance import FULL_THRUST, STEP_S
from app.core.models.vertical import (
    DRAG_1_S,
    GRAVITY_M_S2,
    HOVER_THROTTLE,
    MEASUREMENT_DELAY_S,
    MOTOR_LAG_S,
    QUADRATIC_SHARE,
    force_at_hover,
)
from app.core.policy import Vector
from app.core.records.trajectory import Samples

_COUNTS: Final = np.array([2.0, 2.0, 8.0])
"""Thrust counts per m of altitude error, per m·s of its integral, and per m/s of the climb rate error, for gains kp,
ki, kd of 1: what the fractional bits and the shifts of the loop leave."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearGuidance:
    """A `LinearLoop` with the gains kp, ki, kd, in counts, shape (3,); vehicles are model vectors, shape (8,)."""

    gains: Vector

    texts = MarginTexts(fast_gains="gains", lateness="delay")
    step_s = STEP_S

    def with_fast_gains(self, factor: float) -> Self:
        """All feedback passes through all three gains."""
        return type(self)(factor * self.gains)

    def transition(self, model: Vector, /, *, late_s: float = 0.0) -> Samples:
        """Of integral, altitude, climb rate, thrust, and dead time by its second-order Padé approximation, in which the
        loop's own step is included."""
        from scipy.linalg import expm

        hover, share, lag_s = model[HOVER_THROTTLE], model[QUADRATIC_SHARE], max(model[MOTOR_LAG_S], STEP_S)
        lift_m_s2 = GRAVITY_M_S2 * (1.0 - share + 2.0 * share * hover) / force_at_hover(hover, share)
        dead_s = model[MEASUREMENT_DELAY_S] + late_s + STEP_S
        proportional, integral, damping = -self.gains * _COUNTS / FULL_THRUST
        command = np.array([integral, proportional, damping, 0.0, 0.0, 0.0])
        rates = np.zeros((6, 6))
        rates[0, 1] = rates[1, 2] = rates[4, 5] = 1.0
        rates[2, [2, 3]] = -model[DRAG_1_S], lift_m_s2
        rates[3] = command / lag_s
        rates[3, [3, 5]] = -1.0 / lag_s, -12.0 / dead_s / lag_s
        rates[5] = command
        rates[5, [4, 5]] = -12.0 / dead_s**2, -6.0 / dead_s
        return np.asarray(expm(rates * STEP_S))
