"""What a copter does with its height: climb to one, hold it, come down; the set point that its controller follows."""

import math
from enum import Enum
from typing import Final

from app.vehicles.simdrone.autopilots.copter.cascade import Cascade, SetPoint
from app.vehicles.simdrone.body import MOTORS_OFF, TICK_S, TICK_STEPS, Body, throttle_command

_LANDED_AFTER_S: Final = 1.0
_DEEPEST_SET_POINT_M: Final = 1.0
"""How far below the vehicle the set point of a landing may be: on the ground it presses down, and no more."""
_GENTLE_M_S2: Final = 1.5
"""How fast the set point of a takeoff gains and loses speed."""
_ARRIVED_WITHIN_M: Final = 0.002


class Phase(Enum):
    """What it is about."""

    IDLE = "on the ground, motors still"
    CLIMBING = "to its height of takeoff"
    HOLDING = "its height"
    LANDING = "down to the ground"


class AltitudeGuidance:
    """Flies a body in altitude above the ground, metres up."""

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
        """By height and speed."""
        return self._body.stands

    @property
    def flies(self) -> bool:
        return self.phase is not Phase.IDLE

    def take_off(self, height_m: float, speed_m_s: float) -> None:
        """From the ground, or on from where it is."""
        if self.phase is Phase.IDLE:
            self._cascade.reset()
        self._target_m = self._body.altitude_m
        self._goal_m, self._most_m_s, self._speed_m_s = height_m, speed_m_s, 0.0
        self.phase = Phase.CLIMBING

    def hold(self) -> None:
        """The height it has now."""
        if self.flies:
            self._target_m = self._goal_m = self._body.altitude_m
            self.phase = Phase.HOLDING

    def land(self, speed_m_s: float) -> None:
        if self.flies and self.phase is not Phase.LANDING:
            self._target_m, self._speed_m_s = self._body.altitude_m, speed_m_s
            self._standing_s = 0.0
            self.phase = Phase.LANDING

    def stop(self) -> None:
        """Motors off, wherever it is."""
        self.phase = Phase.IDLE

    def tick(self) -> None:
        """Let one tick pass; a landing ends on the ground."""
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
        """The one of this tick."""
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
        """Gather speed, and shed it in time for the goal."""
        if left_m <= _ARRIVED_WITHIN_M:
            self._target_m = self._goal_m
            self.phase = Phase.HOLDING
            return SetPoint(self._target_m)
        before_m_s = self._speed_m_s
        in_time_m_s = math.sqrt(2.0 * _GENTLE_M_S2 * left_m)
        self._speed_m_s = min(before_m_s + _GENTLE_M_S2 * TICK_S, self._most_m_s, in_time_m_s)
        self._target_m += self._speed_m_s * TICK_S
        return SetPoint(self._target_m, self._speed_m_s, (self._speed_m_s - before_m_s) / TICK_S)
