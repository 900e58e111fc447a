"""Faults that can be injected into a simulated drone: each is one class and one line in `FAULTS`."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar, Final, Protocol

from app.autopilots.dialects import FieldValue
from app.autopilots.simulated.body import TICK_S, Body, Fields, OutgoingMessage, SimulatedAutopilot
from app.core.errors import InputError, Problem
from app.core.policy import is_finite
from app.simdrone.motion_capture import MotionCapture

CONNECT: Final = "connect"
FORM: Final = "NAME[:DURATION]@T, T in seconds after the takeoff command, or NAME[:DURATION]@connect"

_POSITION: Final = "LOCAL_POSITION_NED"
_LOW_MV: Final = 9000
_JUMP_M: Final = 1.0
_JUMP_EVERY: Final = 25
_TWICE_EVERY: Final = 5
_SWAP_EVERY: Final = 4
_WRONG_SYSTEM: Final = 77
_WIND_M_S: Final = 2.0
_DRIFT_M_S: Final = 0.5
_CREEP_M_S: Final = 0.1
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


class Fault:
    """Base of all faults, without effect; faults override what they change."""

    name: ClassVar[str]

    def begin(self, drone: FaultTarget) -> None:
        """Begin the fault."""

    def end(self, drone: FaultTarget) -> None:
        """End the fault."""

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        """Return the changed messages of one tick."""
        return list(messages)

    def transform_frames(self, frames: Sequence[bytes]) -> list[bytes]:
        """Return the changed packets of one tick."""
        return list(frames)

    @property
    def receives_nothing(self) -> bool:
        """Whether nothing is received."""
        return False


class MissingMessages(Fault):
    """Base of faults in which messages of some kinds are not sent."""

    kinds: ClassVar[frozenset[str]]

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [message for message in messages if message.kind not in self.kinds]


class ChangedMessages(Fault, ABC):
    """Base of faults in which messages of some kinds have other values."""

    kinds: ClassVar[frozenset[str]]

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


class Switched(Fault, ABC):
    """Base of faults that are one setting of the drone."""

    @abstractmethod
    def switch(self, drone: FaultTarget, *, on: bool) -> None:
        """Change the setting."""

    def begin(self, drone: FaultTarget) -> None:
        self.switch(drone, on=True)

    def end(self, drone: FaultTarget) -> None:
        self.switch(drone, on=False)


class NoHeartbeat(MissingMessages):
    """HEARTBEAT is not sent."""

    name = "no-heartbeat"
    kinds = frozenset({"HEARTBEAT"})


class ParamUnconfirmed(Switched):
    """PARAM_SET changes nothing and has no reply."""

    name = "param-unconfirmed"

    def switch(self, drone: FaultTarget, *, on: bool) -> None:
        drone.autopilot.ignores_parameters = on


class ArmRefused(Switched):
    """The autopilot refuses to arm, with its own messages."""

    name = "arm-refused"

    def switch(self, drone: FaultTarget, *, on: bool) -> None:
        drone.autopilot.refuses_arming = on


class NoLiftOff(Switched):
    """The motors do not turn, without the autopilot detecting it. In the air the drone falls."""

    name = "no-lift-off"

    def switch(self, drone: FaultTarget, *, on: bool) -> None:
        drone.body.motors_dead = on


class LinkLost(Fault):
    """No packets pass in either direction; the autopilot continues to fly."""

    name = "link-lost"

    def transform_frames(self, frames: Sequence[bytes]) -> list[bytes]:  # noqa: ARG002 - none of them passes
        return []

    @property
    def receives_nothing(self) -> bool:
        return True


class AcknowledgementLost(MissingMessages):
    """Waypoints are taken, but their acknowledgements are lost."""

    name = "ack-lost"
    kinds = frozenset({"MISSION_ACK"})


class SilentWitness(MissingMessages):
    """The autopilot's own judgement of the landing is not sent: SCRIPT_CURRENT, EXTENDED_SYS_STATE."""

    name = "silent-witness"
    kinds = frozenset({"SCRIPT_CURRENT", "EXTENDED_SYS_STATE"})


class Deaf(Fault):
    """The drone receives nothing; its own packets arrive."""

    name = "deaf"

    @property
    def receives_nothing(self) -> bool:
        return True


class TakenOver(Fault):
    """A pilot switches to a manual mode and holds the drone in place, and switches back at the end."""

    name = "taken-over"

    def begin(self, drone: FaultTarget) -> None:
        drone.autopilot.take_over()

    def end(self, drone: FaultTarget) -> None:
        drone.autopilot.hand_back()


class ForeignKill(Fault):
    """Another ground station stops the motors: the setting that stops the throttle, or a forced disarming."""

    name = "foreign-kill"

    def begin(self, drone: FaultTarget) -> None:
        drone.autopilot.kill()


class FliesHome(Fault):
    """The drone flies home by itself: Paparazzi's HOME mode, the return mode of the others."""

    name = "flies-home"

    def begin(self, drone: FaultTarget) -> None:
        drone.autopilot.fly_home()

    def end(self, drone: FaultTarget) -> None:
        drone.autopilot.hand_back()


@dataclass
class FrozenPosition(ChangedMessages):
    """Position messages repeat the last one, with its time; other packets are unchanged."""

    name: ClassVar[str] = "frozen-position"
    kinds: ClassVar[frozenset[str]] = frozenset({_POSITION, "GLOBAL_POSITION_INT"})
    _held: dict[str, Fields] = field(default_factory=dict)

    def change(self, message: OutgoingMessage) -> Fields:
        return self._held.setdefault(message.kind, message.fields)


@dataclass
class JumpingPosition(ChangedMessages):
    """Every 25th position is one metre too high."""

    name: ClassVar[str] = "jumping-position"
    kinds: ClassVar[frozenset[str]] = frozenset({_POSITION})
    _count: int = 0

    def change(self, message: OutgoingMessage) -> Fields:
        self._count += 1
        return {"z": _value(message, "z") - _JUMP_M} if self._count % _JUMP_EVERY == 0 else {}


@dataclass
class StuckAltitude(ChangedMessages):
    """The altitude stays as it was, with a climb rate of 0, while the clock of the position advances."""

    name: ClassVar[str] = "stuck-altitude"
    kinds: ClassVar[frozenset[str]] = frozenset({_POSITION})
    _z_m: float | None = None

    def change(self, message: OutgoingMessage) -> Fields:
        self._z_m = _value(message, "z") if self._z_m is None else self._z_m
        return {"z": self._z_m, "vz": 0.0}


@dataclass
class DriftingAltitude(ChangedMessages):
    """Altitude and climb rate drift down from the true ones by 0.5 m/s, until they show the ground."""

    name: ClassVar[str] = "drifting-altitude"
    kinds: ClassVar[frozenset[str]] = frozenset({_POSITION})
    drift_m_s: ClassVar[float] = _DRIFT_M_S
    _body: Body | None = None
    _since_ms: float | None = None

    def begin(self, drone: FaultTarget) -> None:
        self._body = drone.body

    def change(self, message: OutgoingMessage) -> Fields:
        boot_ms, height_m = _value(message, "time_boot_ms"), 0.0 if self._body is None else self._body.altitude_m
        self._since_ms = boot_ms if self._since_ms is None else self._since_ms
        sunk_m = self.drift_m_s * (boot_ms - self._since_ms) / 1000.0
        if sunk_m > height_m:
            return {"z": _value(message, "z") + height_m, "vz": 0.0}
        return {"z": _value(message, "z") + sunk_m, "vz": _value(message, "vz") + self.drift_m_s}


class CreepingAltitude(DriftingAltitude):
    """Altitude and climb rate drift down from the true ones by 0.1 m/s, until they show the ground."""

    name: ClassVar[str] = "creeping-altitude"
    drift_m_s: ClassVar[float] = _CREEP_M_S


class LeanOscillation(ChangedMessages):
    """The roll angle oscillates with a standard deviation of 28°; the flight is otherwise unchanged."""

    name = "lean-oscillation"
    kinds = frozenset({"ATTITUDE"})

    def change(self, message: OutgoingMessage) -> Fields:
        angle_rad = 2.0 * math.pi * _LEAN_HZ * _value(message, "time_boot_ms") / 1000.0
        return {
            "roll": _LEAN_RAD * math.sin(angle_rad),
            "rollspeed": 2.0 * math.pi * _LEAN_HZ * _LEAN_RAD * math.cos(angle_rad),
        }


class LowBattery(ChangedMessages):
    """The battery voltage is reported as 9.0 V, and the remaining charge as 10 %."""

    name = "low-battery"
    kinds = frozenset({"SYS_STATUS", "BATTERY_STATUS"})

    def change(self, message: OutgoingMessage) -> Fields:
        return _drained(message.fields)


class Reboot(Fault):
    """The autopilot restarts: its motors stop, its clock begins at 0, it sends nothing for two seconds, and its
    parameters are the defaults unless it stores them."""

    name = "reboot"

    def begin(self, drone: FaultTarget) -> None:
        drone.reboot()


@dataclass
class DuplicatedPackets(Fault):
    """Every fifth packet arrives twice."""

    name: ClassVar[str] = "duplicated-packets"
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

    name: ClassVar[str] = "reordered-packets"
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

    name = "wrong-system"

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [replace(message, system=_WRONG_SYSTEM) for message in messages]


class CarriedAway(Switched):
    """In the air the drone drifts north at 2 m/s without correction."""

    name = "carried-away"

    def switch(self, drone: FaultTarget, *, on: bool) -> None:
        drone.body.wind_m_s = _WIND_M_S if on else 0.0


class MocapLost(Switched):
    """Motion capture loses the drone, reports it as not tracked, and repeats its last place."""

    name = "mocap-lost"

    def switch(self, drone: FaultTarget, *, on: bool) -> None:
        drone.cameras.blind = on


class MocapFrozen(Switched):
    """Motion capture repeats its last frame."""

    name = "mocap-frozen"

    def switch(self, drone: FaultTarget, *, on: bool) -> None:
        drone.cameras.stuck = on


class MocapDrift(Switched):
    """The altitude of motion capture drifts from the true one by 0.1 m/s."""

    name = "mocap-drift"

    def switch(self, drone: FaultTarget, *, on: bool) -> None:
        drone.cameras.drifts = on


@dataclass
class GroundDrift(ChangedMessages):
    """The altitude sent rises by 0.45 m within 3.6 s of arming while the drone stands, and sinks as fast afterwards."""

    name: ClassVar[str] = "ground-drift"
    kinds: ClassVar[frozenset[str]] = frozenset({_POSITION})
    _drone: FaultTarget | None = None
    _risen_s: float = 0.0
    _error_m: float = 0.0
    _rate_m_s: float = 0.0

    def begin(self, drone: FaultTarget) -> None:
        self._drone = drone

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        self._rate_m_s = self._drift_m_s()
        self._error_m = max(self._error_m + self._rate_m_s * TICK_S, 0.0)
        return super().transform_messages(messages)

    def change(self, message: OutgoingMessage) -> Fields:
        rate_m_s = self._rate_m_s if self._error_m else 0.0
        return {"z": _value(message, "z") - self._error_m, "vz": _value(message, "vz") - rate_m_s}

    def _drift_m_s(self) -> float:
        """Return the rate of the error: upwards for as long as it stands armed, at most `_GROUND_DRIFT_S`."""
        drone, speed_m_s = self._drone, _GROUND_DRIFT_M / _GROUND_DRIFT_S
        if drone is None or not drone.autopilot.armed:
            self._risen_s = 0.0
        elif drone.body.stands and self._risen_s < _GROUND_DRIFT_S:
            self._risen_s += TICK_S
            return speed_m_s
        return -speed_m_s


FAULTS: Final[Mapping[str, type[Fault]]] = MappingProxyType(
    {
        fault.name: fault
        for fault in (
            NoHeartbeat,
            ParamUnconfirmed,
            ArmRefused,
            NoLiftOff,
            LinkLost,
            Deaf,
            AcknowledgementLost,
            SilentWitness,
            TakenOver,
            ForeignKill,
            FliesHome,
            FrozenPosition,
            JumpingPosition,
            StuckAltitude,
            DriftingAltitude,
            CreepingAltitude,
            LeanOscillation,
            LowBattery,
            Reboot,
            DuplicatedPackets,
            ReorderedPackets,
            WrongSystem,
            CarriedAway,
            MocapLost,
            MocapFrozen,
            MocapDrift,
            GroundDrift,
        )
    }
)


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """A fault and its time: `start_s` after the takeoff command, None from the beginning; with an infinite
    `duration_s` it does not end."""

    fault: str
    start_s: float | None
    duration_s: float = float("inf")

    def is_active(self, now_s: float, takeoff_s: float | None) -> bool:
        """Whether it is active at `now_s`; both times are in seconds since the drone was switched on."""
        if self.start_s is None:
            return now_s < self.duration_s
        return takeoff_s is not None and 0.0 <= now_s - takeoff_s - self.start_s < self.duration_s


def parse_fault(text: str) -> PlannedFault:
    """Parse a fault of `FORM`. Raises InputError with the reason if it is invalid."""
    what, at, when = text.partition("@")
    name, colon, duration = what.partition(":")
    if name not in FAULTS:
        raise _unusable(f"must be one of {', '.join(FAULTS)}, got {name!r}")
    if not at:
        raise _unusable(f"must have a time: {FORM}")
    start_s = None if when == CONNECT else _seconds(when)
    return PlannedFault(name, start_s, _seconds(duration)) if colon else PlannedFault(name, start_s)


class Faults:
    """Planned and active faults of one drone."""

    def __init__(self, planned: Sequence[PlannedFault]) -> None:
        self._waiting: list[tuple[PlannedFault, Fault]] = []
        self._working: list[tuple[PlannedFault, Fault]] = []
        for plan in planned:
            self.add(plan)

    def add(self, plan: PlannedFault) -> None:
        """Add a fault, also in flight."""
        self._waiting.append((plan, FAULTS[plan.fault]()))

    def update(self, now_s: float, takeoff_s: float | None, drone: FaultTarget) -> None:
        """Begin and end faults at their times; each occurs once."""
        for entry in [each for each in self._waiting if each[0].is_active(now_s, takeoff_s)]:
            self._waiting.remove(entry)
            self._working.append(entry)
            entry[1].begin(drone)
        for entry in [each for each in self._working if not each[0].is_active(now_s, takeoff_s)]:
            self._working.remove(entry)
            entry[1].end(drone)

    @property
    def receives_nothing(self) -> bool:
        return any(fault.receives_nothing for _, fault in self._working)

    def messages(self, messages: list[OutgoingMessage]) -> list[OutgoingMessage]:
        for _, fault in self._working:
            messages = fault.transform_messages(messages)
        return messages

    def frames(self, frames: list[bytes]) -> list[bytes]:
        for _, fault in self._working:
            frames = fault.transform_frames(frames)
        return frames


def _value(message: OutgoingMessage, field: str) -> float:
    value = message.fields[field]
    if not isinstance(value, int | float):
        raise TypeError(f"{message.kind}.{field} is not a number")
    return value


def _drained(fields: Fields) -> Fields:
    """Return the fields with low values for the battery."""
    low: dict[str, FieldValue] = dict(fields)
    if "voltage_battery" in low:
        low["voltage_battery"] = _LOW_MV
    voltages = low.get("voltages")
    if isinstance(voltages, Sequence) and not isinstance(voltages, str | bytes):
        low["voltages"] = [_LOW_MV, *voltages[1:]]
    share = low.get("battery_remaining")
    if isinstance(share, int) and share >= 0:
        low["battery_remaining"] = 10
    return low


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = float("nan")
    if not (is_finite(seconds) and seconds >= 0.0):
        raise _unusable(f"a time must be a number of seconds, 0 or more, got {text!r}")
    return seconds


def _unusable(reason: str) -> InputError:
    return InputError(
        "This fault is not valid.",
        problems=(Problem("fault", reason),),
        hint="For example link-lost:8@6, reboot@5 or no-heartbeat@connect.",
    )
