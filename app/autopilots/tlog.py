"""Reader of telemetry logs (.tlog): both directions of a MAVLink connection, each frame preceded by its time in µs.

Altitude and time come from LOCAL_POSITION_NED and the vehicle's own clock, the takeoff from the ground station's
command (a block with such a name, or else the one in which it lifted off; NAV_TAKEOFF, the takeoff mode), the gains
from the vehicle's replies.
"""

import importlib
import struct
from array import array
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType, ModuleType
from typing import BinaryIO, Final, Protocol

import numpy as np

from app.autopilots.ardupilot.log import GAIN_SETS as ARDUPILOT_SETS
from app.autopilots.paparazzi.log import GAIN_SETS as PAPARAZZI_SETS
from app.autopilots.paparazzi.log import PARAMETERS
from app.autopilots.px4.log import GAIN_SETS as PX4_SETS
from app.autopilots.recording import (
    Column,
    Event,
    EventKind,
    GainSets,
    Recording,
    Setting,
    Span,
    increasing,
    names_in,
    spans_of,
)
from app.core.records.trajectory import THROTTLE_HOLDS_S
from app.logs.base import Contents, contents, refused
from app.logs.tlog_frames import frames, is_whole, payload_of

_POSITION: Final = struct.Struct("<I6f")
_RESTART_S: Final = 1.0
_ARMED: Final = 128
_ACCEPTED: Final = (0, 5)
_MOTORS, _LAND, _TAKEOFF, _SET_MODE = 400, 21, 22, 176
_PX4_TAKEOFF_MODE, _PX4_HOVER_MODE = 2, 3

_HINT: Final = (
    "Use a .tlog with the vehicle's heartbeats and LOCAL_POSITION_NED from before the takeoff; it should also "
    "contain the ground station's commands."
)


class _Message(Protocol):
    """A message decoded by pymavlink: fields are attributes with the names in the dialect's definition."""

    def get_srcSystem(self) -> int: ...  # noqa: N802 - pymavlink's name
    def __getattr__(self, name: str) -> float | int | str: ...


@dataclass(frozen=True, slots=True)
class _Autopilot:
    """Differences between autopilots.

    `parameters` maps their parameter names to those of the gains. Some store gains as integers only; some have a
    takeoff mode.
    """

    title: str
    dialect_module: str
    gain_sets: GainSets
    parameters: Mapping[str, str]
    from_ground: bool
    keeps_whole_numbers: bool = False
    has_takeoff_mode: bool = False

    @property
    def dialect(self) -> ModuleType:
        """Loaded when the first log of such a vehicle is read, because a dialect contains a thousand classes."""
        return importlib.import_module(f"pymavlink.dialects.{self.dialect_module}")


def _own_names(sets: GainSets) -> Mapping[str, str]:
    return {name: name for name in names_in(sets)}


_AUTOPILOTS: Final[Mapping[int, _Autopilot]] = MappingProxyType(
    {
        9: _Autopilot(
            "Paparazzi", "v10.paparazzi", PAPARAZZI_SETS, PARAMETERS, from_ground=False, keeps_whole_numbers=True
        ),
        3: _Autopilot("ArduPilot", "v20.ardupilotmega", ARDUPILOT_SETS, _own_names(ARDUPILOT_SETS), from_ground=True),
        12: _Autopilot("PX4", "v20.common", PX4_SETS, _own_names(PX4_SETS), from_ground=True, has_takeoff_mode=True),
    }
)
"""By the autopilot number in the heartbeat.

Paparazzi's altitude is above its local origin, that of the others above the ground.
"""


def read_tlog(stream: BinaryIO) -> Recording:
    """Read a whole log. Raises TrajectoryError if it contains no flight of a known vehicle."""
    data = contents(stream)
    system, autopilot = _vehicle(data)
    conversation = _Telemetry(autopilot, system)
    dialect = autopilot.dialect
    decoder = dialect.MAVLink(None)
    extra = bytes([dialect.MAVLink_local_position_ned_message.crc_extra])
    for frame in frames(data):
        if frame.message == dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            if frame.system == system and is_whole(dialect, data, frame, extra):
                conversation.position(payload_of(data, frame, _POSITION.size), frame.stamp_s(data))
        elif frame.message in conversation.handlers:
            try:
                message: _Message = decoder.decode(bytearray(data[frame.start : frame.end]))
            except dialect.MAVError:
                continue
            conversation.handlers[frame.message](message)
    return conversation.recording()


def _vehicle(data: Contents) -> tuple[int, _Autopilot]:
    """The system that sends the first heartbeat of a known autopilot."""
    for frame in frames(data):
        if frame.message == 0 and frame.end - frame.payload >= 9:
            autopilot = _AUTOPILOTS.get(data[frame.payload + 5])
            if autopilot is not None:
                return frame.system, autopilot
    known = ", ".join(autopilot.title for autopilot in _AUTOPILOTS.values())
    raise refused(f"contains no MAVLink heartbeat of {known}", _HINT)


@dataclass(slots=True)
class _Telemetry:
    """Messages of ground station and vehicle, in the vehicle's time, dated by the last position."""

    autopilot: _Autopilot
    system: int
    handlers: dict[int, Callable[[_Message], None]] = field(init=False)
    _now_s: float = -np.inf
    _offset_s: float = 0.0
    _stamp_s: float = 0.0
    _restarts: int = 0
    _time_s: "array[float]" = field(default_factory=lambda: array("d"))
    _altitude_m: "array[float]" = field(default_factory=lambda: array("d"))
    _climb_rate_m_s: "array[float]" = field(default_factory=lambda: array("d"))
    _battery: list[tuple[float, float]] = field(default_factory=list)
    _throttle: list[tuple[float, float]] = field(default_factory=list)
    _blocks: dict[int, str] = field(default_factory=dict)
    _activated: list[tuple[float, int]] = field(default_factory=list)
    _entered: list[tuple[float, int]] = field(default_factory=list)
    _settings: list[Setting] = field(default_factory=list)
    _asked: dict[str, float] = field(default_factory=dict)
    _sent: dict[int, Event] = field(default_factory=dict)
    _events: list[Event] = field(default_factory=list)
    _armed: bool = False
    _arming: list[tuple[float, bool]] = field(default_factory=list)
    _heard_s: float = -np.inf
    _mode: int | None = None

    def __post_init__(self) -> None:
        by_name = {
            "HEARTBEAT": self._heartbeat,
            "SYS_STATUS": self._status,
            "VFR_HUD": self._reported_throttle,
            "SET_MODE": self._set_mode,
            "PARAM_VALUE": self._parameter,
            "PARAM_SET": self._parameter_asked,
            "COMMAND_INT": self._command,
            "COMMAND_LONG": self._command,
            "COMMAND_ACK": self._answer,
            "SCRIPT_ITEM": self._block,
            "SCRIPT_CURRENT": self._block_entered,
        }
        dialect = self.autopilot.dialect
        numbers = {name: getattr(dialect, f"MAVLINK_MSG_ID_{name}", None) for name in by_name}
        self.handlers = {number: by_name[name] for name, number in numbers.items() if number is not None}

    def position(self, payload: bytes, stamp_s: float) -> None:
        boot_ms, _, _, down_m, _, _, down_m_s = _POSITION.unpack(payload)
        now_s = boot_ms / 1000 + self._offset_s
        if now_s < self._now_s - _RESTART_S:  # the vehicle's clock restarted: continue with the ground's
            self._offset_s += self._now_s - now_s + max(stamp_s - self._stamp_s, 0.0)
            now_s = boot_ms / 1000 + self._offset_s
            self._restarts += 1
        self._now_s, self._stamp_s = now_s, stamp_s
        self._time_s.append(now_s)
        self._altitude_m.append(-down_m)
        self._climb_rate_m_s.append(-down_m_s)

    def recording(self) -> Recording:
        """What was read so far."""
        self._events.extend(self._sent.values())  # a command without an answer counts as accepted
        for time_s, number in self._activated:
            name = self._blocks.get(number, "")
            takes_off = "takeoff" in name.casefold().replace(" ", "").replace("_", "")
            kind = EventKind.TAKEOFF if takes_off else EventKind.COMMAND
            self._events.append(Event(kind, time_s, f"the block {name}" if name else f"block {number}"))
        return Recording(
            title=f"MAVLink log of {self.autopilot.title}",
            clock="vehicle",
            columns=self._columns(),
            from_ground=self.autopilot.from_ground,
            gain_sets=self.autopilot.gain_sets,
            settings=self._settings,
            events=self._events,
            armed=spans_of(self._arming) or None,
            blocks=list(self._commanded_blocks()),
            notes=tuple(self._notes()),
        )

    def _columns(self) -> dict[str, Column]:
        if not self._time_s:
            return {}
        rows = increasing(np.array(self._time_s))
        time_s = np.array(self._time_s)[rows]
        columns = {
            "altitude_m": Column(time_s, np.array(self._altitude_m)[rows], "LOCAL_POSITION_NED.z"),
            "climb_rate_m_s": Column(time_s, np.array(self._climb_rate_m_s)[rows], "LOCAL_POSITION_NED.vz"),
        }
        if self._battery:
            columns["battery_v"] = Column(*np.array(self._battery).T, "SYS_STATUS.voltage_battery")
        if self._throttle:
            columns["throttle"] = Column(*np.array(self._throttle).T, "VFR_HUD.throttle", THROTTLE_HOLDS_S)
        return columns

    def _notes(self) -> Iterator[str]:
        if self._restarts:
            yield f"the vehicle restarted and reset its clock ({self._restarts}×)"
        for name, value in self._asked.items():
            yield f"{name} was set to {value:g}, but the vehicle never confirmed it"

    def _is_vehicle(self, message: _Message) -> bool:
        return message.get_srcSystem() == self.system

    def _heartbeat(self, message: _Message) -> None:
        if not self._is_vehicle(message) or _AUTOPILOTS.get(int(message.autopilot)) is not self.autopilot:
            return
        armed, mode = bool(int(message.base_mode) & _ARMED), int(message.custom_mode)
        if self._armed and not armed:
            self._events.append(Event(EventKind.MOTORS_OFF, self._now_s, "motors off"))
        if self._mode not in {None, mode} and self._armed:
            self._mode_changed(mode)
        self._arming.append((self._heard_s if armed else self._now_s, armed))  # it armed since the heartbeat before
        self._armed, self._mode, self._heard_s = armed, mode, self._now_s

    def _mode_changed(self, mode: int) -> None:
        main, sub = mode >> 16 & 0xFF, mode >> 24 & 0xFF
        if self.autopilot.has_takeoff_mode and main == 4 and sub in {_PX4_TAKEOFF_MODE, _PX4_HOVER_MODE}:
            if sub == _PX4_TAKEOFF_MODE:
                self._events.append(Event(EventKind.TAKEOFF, self._now_s, "takeoff mode"))
            return
        self._events.append(Event(EventKind.MODE, self._now_s, f"mode {sub or mode}"))

    def _status(self, message: _Message) -> None:
        millivolt = int(message.voltage_battery)
        if self._is_vehicle(message) and 0 < millivolt < 0xFFFF and np.isfinite(self._now_s):
            self._battery.append((self._now_s, millivolt / 1000))

    def _reported_throttle(self, message: _Message) -> None:
        percent = int(message.throttle)
        if self._is_vehicle(message) and 0 <= percent <= 100 and np.isfinite(self._now_s):
            self._throttle.append((self._now_s, percent / 100))

    def _set_mode(self, message: _Message) -> None:
        if not self._is_vehicle(message):
            self._events.append(Event(EventKind.COMMAND, self._now_s, "SET_MODE"))

    def _parameter(self, message: _Message) -> None:
        name, value = str(message.param_id), float(message.param_value)
        if not self._is_vehicle(message) or not np.isfinite(value):
            return
        if name in self.autopilot.parameters:
            gain = self.autopilot.parameters[name]
            self._settings.append(Setting(self._now_s, gain, value))
            if self._asked.get(gain) == value:
                del self._asked[gain]
        elif name in ("kil_thr", "aut_kil_thr") and value:
            self._events.append(Event(EventKind.MOTORS_OFF, self._now_s, "motors off"))

    def _parameter_asked(self, message: _Message) -> None:
        name, value = str(message.param_id), float(message.param_value)
        if name in self.autopilot.parameters and not self._is_vehicle(message) and np.isfinite(value):
            kept = float(int(value)) if self.autopilot.keeps_whole_numbers else value
            self._asked[self.autopilot.parameters[name]] = kept

    def _command(self, message: _Message) -> None:
        if self._is_vehicle(message):
            return
        number = int(message.command)
        takeoff = number == _TAKEOFF or (
            number == _SET_MODE and self.autopilot.has_takeoff_mode and message.param3 == _PX4_TAKEOFF_MODE
        )
        lands = number == _LAND or (number == _MOTORS and not message.param1)
        if takeoff or lands or number == _SET_MODE:
            kind = EventKind.TAKEOFF if takeoff else EventKind.COMMAND
            self._sent[number] = Event(kind, self._now_s, f"the command {_command_name(number)}")

    def _answer(self, message: _Message) -> None:
        sent = self._sent.pop(int(message.command), None) if self._is_vehicle(message) else None
        if sent is not None and message.result in _ACCEPTED:
            self._events.append(sent)

    def _block(self, message: _Message) -> None:
        if self._is_vehicle(message):
            self._blocks[int(message.seq)] = str(message.name)
        else:
            self._activated.append((self._now_s, int(message.seq)))

    def _block_entered(self, message: _Message) -> None:
        if self._is_vehicle(message):
            self._entered.append((self._now_s, int(message.seq)))

    def _commanded_blocks(self) -> Iterator[Span]:
        """Every stay in a block that the vehicle entered on command, from the command to that of another one."""
        before_s = -np.inf
        for entered_s, number in self._entered:
            sent_s = [at_s for at_s, sent in self._activated if sent == number and before_s < at_s <= entered_s]
            others_s = (at_s for at_s, other in (*self._entered, *self._activated) if other != number)
            if sent_s:
                yield Span(sent_s[-1], min((at_s for at_s in others_s if at_s >= entered_s), default=np.inf))
            before_s = entered_s


def _command_name(command: int) -> str:
    return {_TAKEOFF: "NAV_TAKEOFF", _LAND: "NAV_LAND", _SET_MODE: "DO_SET_MODE", _MOTORS: "motors off"}[command]
