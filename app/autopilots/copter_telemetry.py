"""What an ArduCopter or PX4 tells of its altitude control in a telemetry log, by its own clock.

Such a log has both directions of a connection, often of several vehicles, components and ground stations; messages may
be lost, late or repeated, and the vehicle may restart.
"""

import struct
from array import array
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Self

import numpy as np

from app.autopilots.recording import increasing
from app.core.records.trajectory import Samples
from app.logs.base import Contents
from app.logs.tlog_frames import Frame, frames, is_whole, payload_of

ARDUPILOT, PAPARAZZI, PX4 = 3, 9, 12
"""Numbers of autopilots in a heartbeat."""
_AUTOPILOTS: Final = frozenset({ARDUPILOT, PAPARAZZI, PX4})

HEARTBEAT: Final = 0
PARAM_VALUE: Final = 22
PARAM_SET: Final = 23
LOCAL_POSITION_NED: Final = 32
SET_POSITION_TARGET_LOCAL_NED: Final = 84
NAV_CONTROLLER_OUTPUT: Final = 62
ATTITUDE_TARGET: Final = 83
POSITION_TARGET_LOCAL_NED: Final = 85

_LAYOUTS: Final[Mapping[int, tuple[struct.Struct, int]]] = MappingProxyType(
    {
        HEARTBEAT: (struct.Struct("<I5B"), 50),
        PARAM_VALUE: (struct.Struct("<4sHH16sB"), 220),
        PARAM_SET: (struct.Struct("<4sBB16sB"), 168),
        LOCAL_POSITION_NED: (struct.Struct("<I6f"), 185),
        SET_POSITION_TARGET_LOCAL_NED: (struct.Struct("<I11fHBBB"), 143),
        NAV_CONTROLLER_OUTPUT: (struct.Struct("<5fhhH"), 183),
        ATTITUDE_TARGET: (struct.Struct("<I8fB"), 22),
        POSITION_TARGET_LOCAL_NED: (struct.Struct("<I11fHB"), 140),
    }
)
"""Fields of each message, and the byte that its checksum begins with."""

_ARMED: Final = 128
_IGNORES_Z: Final = 4
_IGNORES_VZ, _IGNORES_AZ = 1 << 5, 1 << 8
_IGNORES_ATTITUDE: Final = 128
_FROM_GROUND: Final = frozenset({PARAM_SET, SET_POSITION_TARGET_LOCAL_NED})
_INTEGERS: Final = range(1, 9)
_BACK_S: Final = 20.0
"""If the clock goes back by less than this, the message was late."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sender:
    """A vehicle in a log: its system and component, and the numbers of its autopilot and its kind of vehicle."""

    system: int
    component: int
    autopilot: int
    kind: int

    def sent(self, frame: Frame) -> bool:
        """Whether a frame is from it."""
        return (frame.system, frame.component) == (self.system, self.component)


def find_vehicle(data: Contents) -> Sender | None:
    """The vehicle that reports its position most often; None if there is no heartbeat of a known autopilot."""
    found: dict[tuple[int, int], Sender] = {}
    positions: Counter[tuple[int, int]] = Counter()
    for frame in frames(data):
        place = frame.system, frame.component
        if frame.message == LOCAL_POSITION_NED:
            positions[place] += 1
        elif frame.message == HEARTBEAT and place not in found and _is_whole(data, frame):
            _, kind, autopilot, *_ = _unpacked(data, frame)
            if autopilot in _AUTOPILOTS:
                found[place] = Sender(system=place[0], component=place[1], autopilot=autopilot, kind=kind)
    return max(found.values(), key=lambda each: positions[each.system, each.component], default=None)


@dataclass(slots=True)
class _Clock:
    """Seconds since the vehicle's first boot in the log; a restart goes on later, so that no time is used twice."""

    now_s: float = 0.0
    _ahead_s: float = 0.0

    def at(self, boot_ms: int) -> float:
        time_s = boot_ms / 1000 + self._ahead_s
        if time_s < self.now_s - _BACK_S:
            self._ahead_s += self.now_s + _BACK_S - time_s
            time_s = self.now_s + _BACK_S
        self.now_s = max(self.now_s, time_s)
        return time_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Telemetry:
    """One vehicle's reports, altitudes up; the first column of each is the time, s, which increases.

    `positions`, shape (n, 3): altitude, climb rate; `throttles`, (k, 3): demanded share of full, cosine of the lean;
    `targets`, (k, 2): altitude that it flies to, NaN where it flies to none, or was given a speed or an acceleration
    beside it; `errors`, (k, 2): how far its own reference is above it; `states`, (k, 3): armed or not, and its mode.
    `settings` has time, name and value of its parameters, in order; values that nobody had written before hold from −∞
    on. `has_all_parameters` if it sent as many as it has.
    """

    positions: Samples
    throttles: Samples
    targets: Samples
    errors: Samples
    states: Samples
    settings: tuple[tuple[float, str, float], ...]
    has_all_parameters: bool

    @classmethod
    def of(cls, data: Contents, sender: Sender) -> Self:
        """Those of this vehicle in a log; damaged messages are left out."""
        heard = _Heard(sender.system, sender.autopilot == PX4)
        for frame in frames(data):
            concerns = frame.message in _LAYOUTS and (frame.message in _FROM_GROUND or sender.sent(frame))
            if concerns and _is_whole(data, frame):
                heard.take(frame.message, *_unpacked(data, frame))
        return cls(
            positions=_rows(heard.positions, 3),
            throttles=_rows(heard.throttles, 3),
            targets=_rows(heard.targets, 2),
            errors=_rows(heard.errors, 2),
            states=_rows(heard.states, 3),
            settings=tuple(sorted(heard.settings, key=lambda each: each[0])),
            has_all_parameters=0 < heard.parameters <= len(heard.known),
        )


def _is_whole(data: Contents, frame: Frame) -> bool:
    from pymavlink.dialects.v20 import common  # a thousand classes

    return is_whole(common, data, frame, bytes([_LAYOUTS[frame.message][1]]))


def _unpacked(data: Contents, frame: Frame) -> tuple[int, ...]:
    layout, _ = _LAYOUTS[frame.message]
    return layout.unpack(payload_of(data, frame, layout.size))


def _numbers() -> "array[float]":
    return array("d")


def _rows(reports: "array[float]", columns: int) -> Samples:
    """Reports in order of time, without those that are late or repeated, shape (n, columns)."""
    rows = np.array(reports).reshape(-1, columns)
    return rows[increasing(rows[:, 0])]


@dataclass(slots=True)
class _Heard:
    """Reports in order of receipt, those without a time dated by the last one that has one."""

    system: int
    encodes_integers: bool
    """Whether integer parameters are sent byte by byte in place of a float."""
    positions: "array[float]" = field(default_factory=_numbers)
    throttles: "array[float]" = field(default_factory=_numbers)
    targets: "array[float]" = field(default_factory=_numbers)
    errors: "array[float]" = field(default_factory=_numbers)
    states: "array[float]" = field(default_factory=_numbers)
    settings: list[tuple[float, str, float]] = field(default_factory=list)
    known: set[str] = field(default_factory=set)
    parameters: int = 0
    _written: set[str] = field(default_factory=set)
    _is_fed: bool = False
    """Whether the last position target for it has more than a position, which it does not report."""
    _clock: _Clock = field(default_factory=_Clock)
    _takes: Mapping[int, Callable[..., None]] = field(init=False)

    def __post_init__(self) -> None:
        self._takes = {
            HEARTBEAT: self._state,
            PARAM_VALUE: self._parameter,
            PARAM_SET: self._setting,
            LOCAL_POSITION_NED: self._position,
            NAV_CONTROLLER_OUTPUT: self._error,
            ATTITUDE_TARGET: self._throttle,
            POSITION_TARGET_LOCAL_NED: self._target,
            SET_POSITION_TARGET_LOCAL_NED: self._feed,
        }

    def take(self, message: int, *fields: float | bytes) -> None:
        self._takes[message](*fields)

    def _state(self, mode: int, _kind: int, _autopilot: int, base_mode: int, *_: int) -> None:
        self.states.extend((self._clock.now_s, float(bool(base_mode & _ARMED)), float(mode)))

    def _position(self, boot_ms: int, _x: float, _y: float, z: float, _vx: float, _vy: float, vz: float) -> None:
        self.positions.extend((self._clock.at(boot_ms), -z, -vz))

    def _throttle(self, boot_ms: int, _w: float, x: float, y: float, *rest: float) -> None:
        *_, thrust, ignored = rest
        lean = 1.0 if int(ignored) & _IGNORES_ATTITUDE else 1.0 - 2.0 * (x * x + y * y)
        self.throttles.extend((self._clock.at(boot_ms), thrust if 0.0 <= thrust <= 1.0 else np.nan, lean))

    def _target(self, boot_ms: int, _x: float, _y: float, z: float, *rest: float) -> None:
        ignored = int(rest[-2])
        self.targets.extend((self._clock.at(boot_ms), np.nan if ignored & _IGNORES_Z or self._is_fed else -z))

    def _feed(self, _boot_ms: int, *fields: float) -> None:
        (vz, az), (mask, system) = fields[5:9:3], fields[11:13]
        if system == self.system:
            given = ((vz, _IGNORES_VZ), (az, _IGNORES_AZ))
            self._is_fed = any(abs(value) > 0.0 and not int(mask) & ignored for value, ignored in given)

    def _error(self, _roll: float, _pitch: float, altitude: float, *_: float) -> None:
        self.errors.extend((self._clock.now_s, altitude))

    def _parameter(self, value: bytes, count: int, _index: int, name: bytes, kind: int) -> None:
        bytewise = self.encodes_integers and kind in _INTEGERS
        number = float(struct.unpack("<i" if bytewise else "<f", value)[0])
        text = _text(name)
        held = text not in self.known and text not in self._written
        self.settings.append((-np.inf if held else self._clock.now_s, text, number))
        self.known.add(text)
        self.parameters = count

    def _setting(self, _value: bytes, _system: int, _component: int, name: bytes, _kind: int) -> None:
        self._written.add(_text(name))


def _text(name: bytes) -> str:
    return name.split(b"\0")[0].decode("ascii", errors="replace")
