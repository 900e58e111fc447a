"""Kinds of faults of a simulated drone: each is one line in `FAULTS`, and a class if it remembers something."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import ClassVar, Final, Protocol

from app.autopilots.dialects import FieldValue
from app.autopilots.simulated.body import TICK_S, Body, Fields, OutgoingMessage, SimulatedAutopilot
from app.simdrone.motion_capture import MotionCapture

_POSITION: Final = "LOCAL_POSITION_NED"
_LOW_MV: Final = 9000
_JUMP_M: Final = 1.0
_JUMP_EVERY: Final = 25
_TWICE_EVERY: Final = 5
_SWAP_EVERY: Final = 4
_WRONG_SYSTEM: Final = 77
_WIND_M_S: Final = 2.0
_LEAN_RAD: Final = math.radians(28.0 * math.sqrt(2.0))
_LEAN_HZ: Final = 1.7
_GROUND_DRIFT_M: Final = 0.45
_GROUND_DRIFT_S: Final = 3.6


class FaultTarget(Protocol):
    """Parts of a drone that a fault can change."""

    body: Body
    autopilot: SimulatedAutopilot
    cameras: MotionCapture

    def reboot(self) -> None: ...


@dataclass
class Fault:
    """Base of all faults of a drone from their beginning to their end, without effect; faults override what they
    change."""

    drone: FaultTarget
    receives_nothing: ClassVar[bool] = False

    def end(self) -> None:
        """End the fault."""

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        """Return the changed messages of one tick."""
        return list(messages)

    def transform_frames(self, frames: Sequence[bytes]) -> list[bytes]:
        """Return the changed packets of one tick."""
        return list(frames)


@dataclass
class MissingMessages(Fault):
    """Messages of some kinds are not sent."""

    kinds: Collection[str]

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [message for message in messages if message.kind not in self.kinds]


class ChangedMessages(Fault, ABC):
    """Messages of some kinds, by default positions, have other values."""

    kinds: ClassVar[Collection[str]] = (_POSITION,)

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [
            replace(message, fields={**message.fields, **self.change(message)})
            if message.kind in self.kinds
            else message
            for message in messages
        ]

    @abstractmethod
    def change(self, message: OutgoingMessage) -> Fields:
        """Return the fields that differ."""


@dataclass
class Switched(Fault):
    """Something is done to the drone at the beginning (`on`), and undone at the end."""

    switch: Callable[[FaultTarget, bool], None]

    def __post_init__(self) -> None:
        self.switch(self.drone, True)

    def end(self) -> None:
        self.switch(self.drone, False)


def _take_over(drone: FaultTarget, on: bool) -> None:
    """By a pilot, who holds the drone in place."""
    (drone.autopilot.take_over if on else drone.autopilot.hand_back)()


def _fly_home(drone: FaultTarget, on: bool) -> None:
    """By itself: Paparazzi's HOME mode, the return mode of the others."""
    (drone.autopilot.fly_home if on else drone.autopilot.hand_back)()


def _flag(part: str, name: str) -> Callable[[FaultTarget, bool], None]:
    """Sets a flag of a part of the drone."""
    return lambda drone, on: setattr(getattr(drone, part), name, on)


def _carry_away(drone: FaultTarget, on: bool) -> None:
    drone.body.wind_m_s = _WIND_M_S if on else 0.0


class Deaf(Fault):
    """The drone receives nothing; its own packets arrive."""

    receives_nothing = True


class LinkLost(Deaf):
    """No packets pass in either direction; the autopilot continues to fly."""

    def transform_frames(self, frames: Sequence[bytes]) -> list[bytes]:  # noqa: ARG002 - none of them passes
        return []


@dataclass
class FrozenPosition(ChangedMessages):
    """Position messages repeat the last one, with its time; other packets are unchanged."""

    kinds = (_POSITION, "GLOBAL_POSITION_INT")
    _held: dict[str, Fields] = field(default_factory=dict)

    def change(self, message: OutgoingMessage) -> Fields:
        return self._held.setdefault(message.kind, message.fields)


@dataclass
class JumpingPosition(ChangedMessages):
    """Every 25th position is one metre too high."""

    _count: int = 0

    def change(self, message: OutgoingMessage) -> Fields:
        self._count += 1
        return {"z": _value(message, "z") - _JUMP_M} if self._count % _JUMP_EVERY == 0 else {}


@dataclass
class StuckAltitude(ChangedMessages):
    """The altitude stays as it was, with a climb rate of 0, while the clock of the position advances."""

    _z_m: float | None = None

    def change(self, message: OutgoingMessage) -> Fields:
        self._z_m = _value(message, "z") if self._z_m is None else self._z_m
        return {"z": self._z_m, "vz": 0.0}


@dataclass
class DriftingAltitude(ChangedMessages):
    """Altitude and climb rate drift down from the true ones by so much, until they show the ground."""

    drift_m_s: float
    _since_ms: float | None = None

    def change(self, message: OutgoingMessage) -> Fields:
        boot_ms, height_m = _value(message, "time_boot_ms"), self.drone.body.altitude_m
        self._since_ms = boot_ms if self._since_ms is None else self._since_ms
        sunk_m = self.drift_m_s * (boot_ms - self._since_ms) / 1000.0
        if sunk_m > height_m:
            return {"z": _value(message, "z") + height_m, "vz": 0.0}
        return {"z": _value(message, "z") + sunk_m, "vz": _value(message, "vz") + self.drift_m_s}


class LeanOscillation(ChangedMessages):
    """The roll angle oscillates with a standard deviation of 28°; the flight is otherwise unchanged."""

    kinds = ("ATTITUDE",)

    def change(self, message: OutgoingMessage) -> Fields:
        angle_rad = 2.0 * math.pi * _LEAN_HZ * _value(message, "time_boot_ms") / 1000.0
        return {
            "roll": _LEAN_RAD * math.sin(angle_rad),
            "rollspeed": 2.0 * math.pi * _LEAN_HZ * _LEAN_RAD * math.cos(angle_rad),
        }


class LowBattery(ChangedMessages):
    """The battery voltage is reported as 9.0 V, and the remaining charge as 10 %."""

    kinds = ("SYS_STATUS", "BATTERY_STATUS")

    def change(self, message: OutgoingMessage) -> Fields:
        low: dict[str, FieldValue] = {}
        if "voltage_battery" in message.fields:
            low["voltage_battery"] = _LOW_MV
        voltages = message.fields.get("voltages")
        if isinstance(voltages, Sequence) and not isinstance(voltages, str | bytes):
            low["voltages"] = [_LOW_MV, *voltages[1:]]
        share = message.fields.get("battery_remaining")
        if isinstance(share, int) and share >= 0:
            low["battery_remaining"] = 10
        return low


@dataclass
class DuplicatedPackets(Fault):
    """Every fifth packet arrives twice."""

    _count: int = 0

    def transform_frames(self, frames: Sequence[bytes]) -> list[bytes]:
        repeated: list[bytes] = []
        for frame in frames:
            self._count += 1
            repeated += [frame] * (2 if self._count % _TWICE_EVERY == 0 else 1)
        return repeated


@dataclass
class ReorderedPackets(Fault):
    """Every fourth packet arrives after the one that followed it."""

    _count: int = 0
    _late: list[bytes] = field(default_factory=list)

    def transform_frames(self, frames: Sequence[bytes]) -> list[bytes]:
        passed: list[bytes] = []
        for frame in frames:
            self._count += 1
            if self._count % _SWAP_EVERY == 0:
                self._late.append(frame)
            else:
                passed += [frame, *self._late]
                self._late.clear()
        return passed


class WrongSystem(Fault):
    """Every packet comes from system 77."""

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [replace(message, system=_WRONG_SYSTEM) for message in messages]


@dataclass
class GroundDrift(ChangedMessages):
    """The altitude sent rises by 0.45 m within 3.6 s of arming while the drone stands, and sinks as fast afterwards."""

    _risen_s: float = 0.0
    _error_m: float = 0.0
    _rate_m_s: float = 0.0

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        self._rate_m_s = self._drift_m_s()
        self._error_m = max(self._error_m + self._rate_m_s * TICK_S, 0.0)
        return super().transform_messages(messages)

    def change(self, message: OutgoingMessage) -> Fields:
        rate_m_s = self._rate_m_s if self._error_m else 0.0
        return {"z": _value(message, "z") - self._error_m, "vz": _value(message, "vz") - rate_m_s}

    def _drift_m_s(self) -> float:
        """Return the rate of the error: upwards for as long as it stands armed, at most `_GROUND_DRIFT_S`."""
        drone, speed_m_s = self.drone, _GROUND_DRIFT_M / _GROUND_DRIFT_S
        if not drone.autopilot.armed:
            self._risen_s = 0.0
        elif drone.body.stands and self._risen_s < _GROUND_DRIFT_S:
            self._risen_s += TICK_S
            return speed_m_s
        return -speed_m_s


FAULTS: Final[Mapping[str, Callable[[FaultTarget], Fault]]] = {
    "no-heartbeat": partial(MissingMessages, kinds=("HEARTBEAT",)),
    "param-unconfirmed": partial(Switched, switch=_flag("autopilot", "ignores_parameters")),
    "arm-refused": partial(Switched, switch=_flag("autopilot", "refuses_arming")),
    "no-lift-off": partial(Switched, switch=_flag("body", "motors_dead")),
    "link-lost": LinkLost,
    "deaf": Deaf,
    "ack-lost": partial(MissingMessages, kinds=("MISSION_ACK",)),
    "silent-witness": partial(MissingMessages, kinds=("SCRIPT_CURRENT", "EXTENDED_SYS_STATE")),
    "taken-over": partial(Switched, switch=_take_over),
    "foreign-kill": partial(Switched, switch=lambda drone, on: drone.autopilot.kill() if on else None),
    "flies-home": partial(Switched, switch=_fly_home),
    "frozen-position": FrozenPosition,
    "jumping-position": JumpingPosition,
    "stuck-altitude": StuckAltitude,
    "drifting-altitude": partial(DriftingAltitude, drift_m_s=0.5),
    "creeping-altitude": partial(DriftingAltitude, drift_m_s=0.1),
    "lean-oscillation": LeanOscillation,
    "low-battery": LowBattery,
    "reboot": partial(Switched, switch=lambda drone, on: drone.reboot() if on else None),
    "duplicated-packets": DuplicatedPackets,
    "reordered-packets": ReorderedPackets,
    "wrong-system": WrongSystem,
    "carried-away": partial(Switched, switch=_carry_away),
    "mocap-lost": partial(Switched, switch=_flag("cameras", "blind")),
    "mocap-frozen": partial(Switched, switch=_flag("cameras", "stuck")),
    "mocap-drift": partial(Switched, switch=_flag("cameras", "drifts")),
    "ground-drift": GroundDrift,
}
"""What each does is in docs/sim-drone.md."""


def _value(message: OutgoingMessage, field: str) -> float:
    value = message.fields[field]
    if not isinstance(value, int | float):
        raise TypeError(f"{message.kind}.{field} is not a number")
    return value
