"""Altitude and climb rate as Paparazzi estimates them: true in flight, and wrong in a fall.

In a recorded fall from 3.3 m with stopped motors its position fixes, ten a second, moved the estimated altitude by
−0.11, −0.30, −0.45 and −0.52 m, at −2.4, −3.7, −5.0 and −6.8 m/s. After the impact the estimate went on to 1.2 m below
the ground, and took 1.2 s to come back.
"""

from typing import Final

FALLS_M_S: Final = -2.0
FIX_S: Final = 0.098
"""Interval of the position fixes."""
_STEP_S: Final = 0.08
"""Step of a fix as the time in which it falls as far."""
_KEPT: Final = 0.75
"""Share of the error in altitude that is left by a fix after the impact."""
_SLOWED_M_S: Final = 0.7
"""Reduction of the estimated speed by a fix after the impact."""


class FallEstimator:
    """Errors of the estimate, to be updated with every fix: `error_m` is added to the true altitude."""

    def __init__(self) -> None:
        self.error_m = 0.0
        self._sinks_m_s = 0.0

    def fix(self, altitude_m: float, climb_rate_m_s: float, *, is_driven: bool) -> None:
        """Process a position fix of a vehicle at this true altitude above the ground; `is_driven`: its motors turn."""
        if climb_rate_m_s < FALLS_M_S and not is_driven:
            self.error_m += _STEP_S * climb_rate_m_s if altitude_m + self.error_m > 0.0 else 0.0
            self._sinks_m_s = climb_rate_m_s
        else:
            self.error_m *= _KEPT
            self._sinks_m_s = min(self._sinks_m_s + _SLOWED_M_S, 0.0)

    def climb_rate_m_s(self, true_m_s: float) -> float:
        """Return the estimated climb rate."""
        return min(true_m_s, self._sinks_m_s) if self._sinks_m_s else true_m_s
