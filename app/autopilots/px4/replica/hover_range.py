"""The range of hover thrusts that PX4's estimator finds in flight."""

from collections.abc import Mapping
from typing import Final

from app.core.control.parameter_checks import require_within

HOVER_THRUSTS: Final = (0.1, 0.8)
"""Documented range of MPC_THR_HOVER."""
HOVER_RANGE_NAME: Final = "HTE_THR_RANGE"
HOVER_RANGE: Final = 0.2
"""How far the estimated hover thrust may be from MPC_THR_HOVER, by default."""
_HIGHEST_LOW, _LOWEST_HIGH, _HIGHEST = 0.8, 0.2, 0.9
"""Ends of its limits, whatever the parameters are."""


def hover_deviation(values: Mapping[str, float]) -> float:
    """HTE_THR_RANGE of the firmware's values by name, or its default. Raises InputError if it is outside its range."""
    require_within(values, {HOVER_RANGE_NAME: (0.0, 1.0)})
    return values.get(HOVER_RANGE_NAME, HOVER_RANGE)


def hover_limits(hover_thrust: float, deviation: float) -> tuple[float, float]:
    """Least and largest hover thrust that the estimator finds, with MPC_THR_HOVER and HTE_THR_RANGE."""
    low, high = hover_thrust - deviation, hover_thrust + deviation
    return min(max(low, 0.0), _HIGHEST_LOW), min(max(high, _LOWEST_HIGH), _HIGHEST)
