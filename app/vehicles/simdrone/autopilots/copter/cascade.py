"""Cascaded altitude controllers with the gains of ArduPilot and PX4 by their own names.

They are not replicas: the loops have the shape of the real ones (altitude, climb rate, acceleration) and their gains
act in the same places and units, but filters, limits and the shaping of set points are simplified.
"""

from dataclasses import dataclass
from typing import Final, Protocol

from app.core.plants.vertical import GRAVITY_M_S2
from app.vehicles.simdrone.body import TICK_S

HOVER_THRUST: Final = 0.62
"""What both believe to hover on; their integrators carry the rest."""

_FASTEST_M_S: Final = 3.0
_STRONGEST_M_S2: Final = 8.0
_LARGEST_INTEGRAL: Final = 0.3
_ACCELERATION_FILTER_S: Final = 0.02


@dataclass(frozen=True, slots=True)
class SetPoint:
    """Where the vehicle should be, and how that moves; up."""

    altitude_m: float
    climb_m_s: float = 0.0
    acceleration_m_s2: float = 0.0


class Cascade(Protocol):
    """An altitude controller, asked once a tick."""

    def reset(self) -> None:
        """Forget the past: the vehicle stands on the ground."""
        ...

    def thrust(self, target: SetPoint, altitude_m: float, climb_m_s: float) -> float:
        """The thrust, a share of full, that leads to the set point."""
        ...


class ThreeStage:
    """ArduPilot: P on altitude (1/s), P on climb rate (1/s), PID on acceleration (tenths of full thrust per m/s²)."""

    def __init__(self) -> None:
        self.altitude_p = self.climb_p = self.acceleration_p = self.acceleration_i = self.acceleration_d = 0.0
        self.reset()

    def reset(self) -> None:
        self._integral = self._acceleration = self._error = 0.0
        self._climb: float | None = None

    def thrust(self, target: SetPoint, altitude_m: float, climb_m_s: float) -> float:
        self._sense(climb_m_s)
        speed = _limit(target.climb_m_s + self.altitude_p * (target.altitude_m - altitude_m), _FASTEST_M_S)
        wanted = _limit(target.acceleration_m_s2 + self.climb_p * (speed - climb_m_s), _STRONGEST_M_S2)
        error = wanted - self._acceleration
        self._integral = _limit(self._integral + 0.1 * self.acceleration_i * error * TICK_S, _LARGEST_INTEGRAL)
        change = (error - self._error) / TICK_S
        self._error = error
        return HOVER_THRUST + 0.1 * (self.acceleration_p * error + self.acceleration_d * change) + self._integral

    def _sense(self, climb_m_s: float) -> None:
        """Acceleration, from the climb rate, through a first-order filter."""
        before = climb_m_s if self._climb is None else self._climb
        measured = (climb_m_s - before) / TICK_S
        self._acceleration += TICK_S / (TICK_S + _ACCELERATION_FILTER_S) * (measured - self._acceleration)
        self._climb = climb_m_s


class TwoStage:
    """PX4: P on altitude (1/s), PID on climb rate, giving an acceleration that thrust is scaled to."""

    def __init__(self) -> None:
        self.altitude_p = self.climb_p = self.climb_i = self.climb_d = 0.0
        self.reset()

    def reset(self) -> None:
        self._integral = self._slope = 0.0
        self._climb: float | None = None

    def thrust(self, target: SetPoint, altitude_m: float, climb_m_s: float) -> float:
        before = climb_m_s if self._climb is None else self._climb
        self._slope += TICK_S / (TICK_S + _ACCELERATION_FILTER_S) * ((climb_m_s - before) / TICK_S - self._slope)
        self._climb = climb_m_s
        speed = _limit(target.climb_m_s + self.altitude_p * (target.altitude_m - altitude_m), _FASTEST_M_S)
        error = speed - climb_m_s
        most = _LARGEST_INTEGRAL * GRAVITY_M_S2 / HOVER_THRUST
        self._integral = _limit(self._integral + self.climb_i * error * TICK_S, most)
        acceleration = target.acceleration_m_s2 + self.climb_p * error + self._integral - self.climb_d * self._slope
        return HOVER_THRUST * (1.0 + _limit(acceleration, _STRONGEST_M_S2) / GRAVITY_M_S2)


def _limit(value: float, most: float) -> float:
    return min(max(value, -most), most)
