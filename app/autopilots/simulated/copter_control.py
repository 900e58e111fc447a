"""Altitude control of the simulated copters: phases of a flight, set points of position messages, and the interface of
the two controllers, which fly by the exact replicas of ArduCopter's and PX4's vertical loops.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from app.autopilots.dialects import Message, number
from app.autopilots.simulated.body import MOTORS_OFF, TICK_S, TICK_STEPS, Body, throttle_command

LOCAL_NED: Final = 1
"""MAV_FRAME."""
IGNORED_BY: Final[Mapping[str, int]] = {"z": 1 << 2, "vz": 1 << 5, "afz": 1 << 8}
"""Bits of POSITION_TARGET_TYPEMASK for the vertical fields of a position message."""

_LANDED_AFTER_S: Final = 1.0


class Phase(Enum):
    """Phases of a flight."""

    IDLE = "on the ground, motors still"
    CLIMBING = "to its height of takeoff"
    HOLDING = "its height, or that of its target"
    LANDING = "down to the ground"


@dataclass(frozen=True, slots=True)
class SetPoint:
    """Altitude above the ground, climb rate and acceleration, positive up; NaN where none is given."""

    altitude_m: float = math.nan
    climb_m_s: float = math.nan
    acceleration_m_s2: float = math.nan

    @property
    def given(self) -> list[float]:
        """The values that are given."""
        return [each for each in (self.altitude_m, self.climb_m_s, self.acceleration_m_s2) if not math.isnan(each)]

    @classmethod
    def from_message(cls, message: Message, *, ground_m: float) -> "SetPoint":
        """Return the vertical part of SET_POSITION_TARGET_LOCAL_NED; `ground_m` is the height of the ground in its
        frame."""
        mask = int(number(message, "type_mask"))
        z, vz, az = (math.nan if mask & ignored else -number(message, name) for name, ignored in IGNORED_BY.items())
        return cls(z - ground_m, vz, az)


class AltitudeController(ABC):
    """Controller of a body's altitude above the ground, m, positive up, from arming to disarming."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self.phase = Phase.IDLE
        self._armed_s: float | None = None
        self._standing_s = 0.0

    # ------------------------------------------------------------ differences between autopilots

    @abstractmethod
    def take_off(self, height_m: float) -> None:
        """Climb from the ground to this height. Armed, in phase IDLE."""

    @abstractmethod
    def hold(self) -> None:
        """Stop and hold the altitude; on the ground, abandon the takeoff."""

    @abstractmethod
    def begin_landing(self) -> None:
        """Descend from now on; in flight or at the beginning of a takeoff."""

    @abstractmethod
    def run(self) -> float:
        """Run the loop on the body's present state for a tick; return the throttle of the motors as a share of full."""

    @property
    @abstractmethod
    def set_point(self) -> SetPoint:
        """Set point in force, in flight."""

    @property
    @abstractmethod
    def error_m(self) -> float:
        """Shaped target of altitude minus altitude, as the loop has used it last."""

    @property
    @abstractmethod
    def demand(self) -> float:
        """Throttle that the loop has demanded last, 0 … 1, before any filter of the motors."""

    # ------------------------------------------------------------ common to both

    @property
    def flies(self) -> bool:
        return self.phase is not Phase.IDLE

    def arm(self) -> None:
        self._armed_s = 0.0

    def land(self) -> None:
        if self.flies and self.phase is not Phase.LANDING:
            self._standing_s = 0.0
            self.phase = Phase.LANDING
            self.begin_landing()

    def stop(self) -> None:
        """Disarm: stop the motors at any height."""
        self.phase = Phase.IDLE
        self._armed_s = None

    def tick(self) -> None:
        """Advance by one tick; a landing ends on the ground."""
        if self._armed_s is not None:
            self._armed_s += TICK_S
        throttle = self.run()
        turns = self.flies and not math.isnan(throttle)  # NaN: the loop diverged, with gains beyond all bounds
        self._body.advance(TICK_STEPS, throttle_command(throttle) if turns else MOTORS_OFF)
        if self.phase is Phase.LANDING:
            self._standing_s = max(self._standing_s + (TICK_S if self._body.stands else -TICK_S), 0.0)
            if self._standing_s >= _LANDED_AFTER_S:
                self.phase = Phase.IDLE
