"""Cascaded altitude controllers with the gains of ArduPilot and PX4, and guidance of their set point: climb to an
altitude, hold it, land.

They are not replicas: the loops have the structure of the real ones (altitude, climb rate, acceleration), with gains in
the same places and units, but filters, limits and set point shaping are simplified.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final, Protocol

from app.core.models.vertical import GRAVITY_M_S2
from app.simdrone.body import MOTORS_OFF, TICK_S, TICK_STEPS, Body, throttle_command

HOVER_THRUST: Final = 0.62
"""Hover thrust assumed by both controllers; their integrators correct it."""

_FASTEST_M_S: Final = 3.0
_STRONGEST_M_S2: Final = 8.0
_LARGEST_INTEGRAL: Final = 0.3
_ACCELERATION_FILTER_S: Final = 0.02


@dataclass(frozen=True, slots=True)
class SetPoint:
    """Set point of altitude and its derivatives; positive up."""

    altitude_m: float
    climb_m_s: float = 0.0
    acceleration_m_s2: float = 0.0


class Cascade(Protocol):
    """An altitude controller, called once per tick."""

    def reset(self) -> None:
        """Reset the state, on the ground."""
        ...

    def thrust(self, target: SetPoint, altitude_m: float, climb_m_s: float) -> float:
        """Return the thrust as a share of full."""
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
        """Update the acceleration from the climb rate by a first-order filter."""
        before = climb_m_s if self._climb is None else self._climb
        measured = (climb_m_s - before) / TICK_S
        self._acceleration += TICK_S / (TICK_S + _ACCELERATION_FILTER_S) * (measured - self._acceleration)
        self._climb = climb_m_s


class TwoStage:
    """PX4: P on altitude (1/s), PID on climb rate, whose output is an acceleration that is converted to thrust."""

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


_LANDED_AFTER_S: Final = 1.0
_DEEPEST_SET_POINT_M: Final = 1.0
"""Greatest distance of the set point of a landing below the vehicle; limits the downward command on the ground."""
_GENTLE_M_S2: Final = 1.5
"""Acceleration of the set point of a takeoff."""
_ARRIVED_WITHIN_M: Final = 0.002


class Phase(Enum):
    """Phases of a flight."""

    IDLE = "on the ground, motors still"
    CLIMBING = "to its height of takeoff"
    HOLDING = "its height"
    LANDING = "down to the ground"


class AltitudeGuidance:
    """Guidance of a body's altitude above the ground, m, positive up."""

    def __init__(self, body: Body, cascade: Cascade) -> None:
        self._body = body
        self._cascade = cascade
        self.phase = Phase.IDLE
        self._target_m = 0.0
        self._goal_m = 0.0
        self._most_m_s = self._speed_m_s = 0.0
        self._standing_s = 0.0

    @property
    def is_landed(self) -> bool:
        """Whether it is on the ground, by height and speed."""
        return self._body.stands

    @property
    def flies(self) -> bool:
        return self.phase is not Phase.IDLE

    @property
    def left_m(self) -> float:
        """Climb that is left to its height, m."""
        return self._goal_m - self._body.altitude_m

    def take_off(self, height_m: float, speed_m_s: float) -> None:
        """Climb from the ground or from the current altitude."""
        if self.phase is Phase.IDLE:
            self._cascade.reset()
        self._target_m = self._body.altitude_m
        self._goal_m, self._most_m_s, self._speed_m_s = height_m, speed_m_s, 0.0
        self.phase = Phase.CLIMBING

    def hold(self) -> None:
        """Hold the current altitude."""
        if self.flies:
            self._target_m = self._goal_m = self._body.altitude_m
            self.phase = Phase.HOLDING

    def land(self, speed_m_s: float) -> None:
        if self.flies and self.phase is not Phase.LANDING:
            self._target_m, self._speed_m_s = self._body.altitude_m, speed_m_s
            self._standing_s = 0.0
            self.phase = Phase.LANDING

    def stop(self) -> None:
        """Stop the motors at any height."""
        self.phase = Phase.IDLE

    def tick(self) -> None:
        """Advance by one tick; a landing ends on the ground."""
        if self.phase is Phase.IDLE:
            self._body.advance(TICK_STEPS, MOTORS_OFF)
            return
        target, body = self._set_point(), self._body
        thrust = self._cascade.thrust(target, body.altitude_m, body.climb_rate_m_s)
        body.advance(TICK_STEPS, throttle_command(thrust))
        if self.phase is Phase.LANDING:
            self._standing_s = max(self._standing_s + (TICK_S if body.stands else -TICK_S), 0.0)
            if self._standing_s >= _LANDED_AFTER_S:
                self.stop()

    def _set_point(self) -> SetPoint:
        """Return the set point of this tick."""
        match self.phase:
            case Phase.CLIMBING:
                return self._climb_on(self._goal_m - self._target_m)
            case Phase.LANDING:
                deepest_m = self._body.altitude_m - _DEEPEST_SET_POINT_M
                self._target_m = max(self._target_m - self._speed_m_s * TICK_S, deepest_m)
                return SetPoint(self._target_m, -self._speed_m_s)
            case _:
                return SetPoint(self._target_m)

    def _climb_on(self, left_m: float) -> SetPoint:
        """Accelerate, and decelerate in time for the goal."""
        if left_m <= _ARRIVED_WITHIN_M:
            self._target_m = self._goal_m
            self.phase = Phase.HOLDING
            return SetPoint(self._target_m)
        before_m_s = self._speed_m_s
        in_time_m_s = math.sqrt(2.0 * _GENTLE_M_S2 * left_m)
        self._speed_m_s = min(before_m_s + _GENTLE_M_S2 * TICK_S, self._most_m_s, in_time_m_s)
        self._target_m += self._speed_m_s * TICK_S
        return SetPoint(self._target_m, self._speed_m_s, (self._speed_m_s - before_m_s) / TICK_S)
