"""Faults that can be injected into a simulated drone: each is one class and one line in `FAULTS`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar, Final, Protocol

from app.core.errors import InputError, Problem
from app.core.policy import is_finite
from app.simdrone.body import TICK_S, Autopilot, Body, Fields, OutgoingMessage
from app.simdrone.motion_capture import MotionCapture
from app.vehicles.mavlink.dialects import FieldValue

CONNECT: Final = "connect"
FORM: Final = "NAME[:DURATION]@T, T in seconds after the takeoff command, or NAME[:DURATION]@connect"

_POSITIONS: Final = frozenset({"LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"})
_LOW_MV: Final = 9000
_JUMP_M: Final = 1.0
_JUMP_EVERY: Final = 25
_TWICE_EVERY: Final = 5
_SWAP_EVERY: Final = 4
_WRONG_SYSTEM: Final = 77
_WIND_M_S: Final = 2.0
_DRIFT_M: Final = 0.45
_DRIFT_S: Final = 3.6


class FaultTarget(Protocol):
    """Parts of a drone that a fault can change."""

    body: Body
    autopilot: Autopilot
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


class NoHeartbeat(Fault):
    """HEARTBEAT is not sent."""

    name = "no-heartbeat"

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [message for message in messages if message.kind != "HEARTBEAT"]


class ParamUnconfirmed(Fault):
    """PARAM_SET changes nothing and has no reply."""

    name = "param-unconfirmed"

    def begin(self, drone: FaultTarget) -> None:
        drone.autopilot.ignores_parameters = True

    def end(self, drone: FaultTarget) -> None:
        drone.autopilot.ignores_parameters = False


class ArmRefused(Fault):
    """The autopilot refuses to arm, with its own messages."""

    name = "arm-refused"

    def begin(self, drone: FaultTarget) -> None:
        drone.autopilot.refuses_arming = True

    def end(self, drone: FaultTarget) -> None:
        drone.autopilot.refuses_arming = False


class NoLiftOff(Fault):
    """The motors do not turn, without the autopilot detecting it. In the air the drone falls."""

    name = "no-lift-off"

    def begin(self, drone: FaultTarget) -> None:
        drone.body.motors_dead = True

    def end(self, drone: FaultTarget) -> None:
        drone.body.motors_dead = False


class LinkLost(Fault):
    """No packets pass in either direction; the autopilot continues to fly."""

    name = "link-lost"

    def transform_frames(self, frames: Sequence[bytes]) -> list[bytes]:  # noqa: ARG002 - none of them passes
        return []

    @property
    def receives_nothing(self) -> bool:
        return True


class AcknowledgementLost(Fault):
    """Waypoints are taken, but their acknowledgements are lost."""

    name = "ack-lost"

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [message for message in messages if message.kind != "MISSION_ACK"]


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


@dataclass
class FrozenPosition(Fault):
    """Position messages repeat the last one, with its time; other packets are unchanged."""

    name: ClassVar[str] = "frozen-position"
    _held: dict[str, OutgoingMessage] = field(default_factory=dict)

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [
            self._held.setdefault(message.kind, message) if message.kind in _POSITIONS else message
            for message in messages
        ]


@dataclass
class JumpingPosition(Fault):
    """Every 25th position is one metre too high."""

    name: ClassVar[str] = "jumping-position"
    _count: int = 0

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [self._jumped(message) for message in messages]

    def _jumped(self, message: OutgoingMessage) -> OutgoingMessage:
        z = message.fields.get("z")
        if message.kind != "LOCAL_POSITION_NED" or not isinstance(z, int | float):
            return message
        self._count += 1
        jumps = self._count % _JUMP_EVERY == 0
        return replace(message, fields={**message.fields, "z": z - _JUMP_M}) if jumps else message


class LowBattery(Fault):
    """The battery voltage is reported as 9.0 V, and the remaining charge as 10 %."""

    name = "low-battery"

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [replace(message, fields=_drained(message.fields)) for message in messages]


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


class CarriedAway(Fault):
    """In the air the drone drifts north at 2 m/s without correction."""

    name = "carried-away"

    def begin(self, drone: FaultTarget) -> None:
        drone.body.wind_m_s = _WIND_M_S

    def end(self, drone: FaultTarget) -> None:
        drone.body.wind_m_s = 0.0


class MocapLost(Fault):
    """Motion capture loses the drone, reports it as not tracked, and repeats its last place."""

    name = "mocap-lost"

    def begin(self, drone: FaultTarget) -> None:
        drone.cameras.blind = True

    def end(self, drone: FaultTarget) -> None:
        drone.cameras.blind = False


class MocapFrozen(Fault):
    """Motion capture repeats its last frame."""

    name = "mocap-frozen"

    def begin(self, drone: FaultTarget) -> None:
        drone.cameras.stuck = True

    def end(self, drone: FaultTarget) -> None:
        drone.cameras.stuck = False


class MocapDrift(Fault):
    """The altitude of motion capture drifts from the true one by 0.1 m/s."""

    name = "mocap-drift"

    def begin(self, drone: FaultTarget) -> None:
        drone.cameras.drifts = True

    def end(self, drone: FaultTarget) -> None:
        drone.cameras.drifts = False


@dataclass
class GroundDrift(Fault):
    """The altitude sent rises by 0.45 m within 3.6 s of arming while the drone stands, and sinks as fast afterwards."""

    name: ClassVar[str] = "ground-drift"
    _drone: FaultTarget | None = None
    _risen_s: float = 0.0
    _error_m: float = 0.0

    def begin(self, drone: FaultTarget) -> None:
        self._drone = drone

    def transform_messages(self, messages: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        rate_m_s = self._rate_m_s()
        self._error_m = max(self._error_m + rate_m_s * TICK_S, 0.0)
        added = {"z": -self._error_m, "vz": -rate_m_s if self._error_m else 0.0}
        return [
            replace(message, fields=_shifted(message.fields, added))
            if message.kind == "LOCAL_POSITION_NED"
            else message
            for message in messages
        ]

    def _rate_m_s(self) -> float:
        """Return the rate of the error: upwards for as long as it stands armed, at most `_DRIFT_S`."""
        drone, speed_m_s = self._drone, _DRIFT_M / _DRIFT_S
        if drone is None or not drone.autopilot.armed:
            self._risen_s = 0.0
        elif drone.body.stands and self._risen_s < _DRIFT_S:
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
            TakenOver,
            FrozenPosition,
            JumpingPosition,
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


def _shifted(fields: Fields, added: Mapping[str, float]) -> Fields:
    """Return the fields with these values added to some of them."""
    numbers = {name: value for name in added if isinstance(value := fields[name], int | float)}
    return {**fields, **{name: value + added[name] for name, value in numbers.items()}}


def _drained(fields: Mapping[str, FieldValue]) -> dict[str, FieldValue]:
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
