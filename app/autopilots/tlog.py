"""Telemetry logs (.tlog) to a `Recording` of each vehicle: what it reports, and what is asked of it.

Such a log has both directions of a connection, often of several vehicles, components and ground stations; messages may
be lost, late or repeated, and a vehicle may restart. Time is the vehicle's own clock: messages without one are dated
by the last message that has one. A takeoff begins with the ground station's command (a block with such a name, or else
the one in which it lifted off; NAV_TAKEOFF, the takeoff mode); parameters are those that the vehicle replies with.
"""

import struct
from array import array
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.autopilot import GainParameter
from app.autopilots.mavlink import UID2_BYTES, hardware_id, uid_of
from app.autopilots.recording import (
    CLOCK_SET_S,
    LONGEST_INTERVAL_S,
    Event,
    EventKind,
    Recording,
    Setting,
    Source,
    Span,
    columns_of,
    date_of,
    release_of,
    restarts,
    spans_of,
)
from app.autopilots.tlog_vehicles import Vehicle, find_vehicles
from app.core.records.trajectory import THROTTLE_HOLDS_S
from app.logs.base import Table, contents
from app.logs.tlog import Message, messages

SOURCES: Final[Mapping[str, Source]] = {
    "altitude_m": Source("LOCAL_POSITION_NED", "z", -1.0),
    "climb_rate_m_s": Source("LOCAL_POSITION_NED", "vz", -1.0),
    "demanded_throttle": Source("ATTITUDE_TARGET", "thrust"),
    "lean": Source("ATTITUDE_TARGET", "lean"),
    "target_altitude_m": Source("POSITION_TARGET_LOCAL_NED", "z", -1.0, holds_s=LONGEST_INTERVAL_S),
    "reference_error_m": Source("NAV_CONTROLLER_OUTPUT", "alt_error"),
    "is_armed": Source("HEARTBEAT", "armed", holds_s=np.inf),
    "mode": Source("HEARTBEAT", "custom_mode", holds_s=np.inf),
    "battery_v": Source("SYS_STATUS", "voltage_battery"),
    "throttle": Source("VFR_HUD", "throttle", holds_s=THROTTLE_HOLDS_S),
}
"""`lean` is the cosine of the demanded lean, `reference_error_m` how far the vehicle's own reference is above it; the
target is NaN where the vehicle flies to none, or was given a speed or an acceleration beside it."""
_ABOVE_HOME: Final[Mapping[str, Source]] = {
    "altitude_m": Source("GLOBAL_POSITION_INT", "relative_alt", 1e-3),
    "climb_rate_m_s": Source("GLOBAL_POSITION_INT", "vz", -1e-2),
}
"""In place of those in the vehicle's own frame, of one that does not report its position in it: targets in it have
another datum."""
_REPORTED: Final = (*SOURCES.values(), *_ABOVE_HOME.values())
_FIELDS: Final = {
    each.message: [source.field for source in _REPORTED if source.message == each.message] for each in _REPORTED
}
"""Of each message that is reported."""
_TIME: Final = "time_s"
_BACK_S: Final = 20.0
"""If the clock goes back by less than this, and not to a time since its last message, the message was late."""
_SHORTEST_BOOT_S: Final = 1.0
_LONGEST_OFF_S: Final = 86_400.0
"""If the ground's time jumps by more than this, its clock was set."""
_APART_S: Final = 2.0
_ARMED: Final = 128
_ACCEPTED: Final = (0, 5)
_MOTORS, _LAND, _TAKEOFF, _SET_MODE = 400, 21, 22, 176
_COMMANDS: Final = MappingProxyType(
    {_TAKEOFF: "NAV_TAKEOFF", _LAND: "NAV_LAND", _SET_MODE: "DO_SET_MODE", _MOTORS: "motors off"}
)
_PX4_TAKEOFF_MODE, _PX4_HOVER_MODE = 2, 3
_IGNORES_Z: Final = 4
_IGNORES_VZ, _IGNORES_AZ = 1 << 5, 1 << 8
_IGNORES_ATTITUDE: Final = 128
_INTEGERS: Final = range(1, 9)
_UID: Final = slice(8, 16)
"""The place of the shorter hardware id in AUTOPILOT_VERSION."""


def read_tlog(stream: BinaryIO) -> Recording:
    """Decode the messages of the vehicle that reports its position most often, and of the `others`. Raises
    TrajectoryError if there is no heartbeat of a known autopilot."""
    data = contents(stream)
    decoders = {(each.system, each.component): _Decoder(each) for each in find_vehicles(data)}
    for library in {each.vehicle.autopilot.dialect.library for each in decoders.values()}:
        using = {place: each for place, each in decoders.items() if each.vehicle.autopilot.dialect.library is library}
        for message in messages(data, library, {*_REPORTS, *_REQUESTS}):
            sender = using.get((message.system, message.component))
            if sender is not None and message.name in _REPORTS:
                _REPORTS[message.name](sender, message)
            elif message.name in _REQUESTS:
                for each in using.values():
                    if each.vehicle.is_asked(message):
                        _REQUESTS[message.name](each, message)
    recordings = [each.recording([*decoders.values()]) for each in decoders.values()]
    first, *others = sorted(recordings, key=lambda each: "altitude_m" not in each.columns)
    return replace(first, others=[each for each in others if "altitude_m" in each.columns])


@dataclass(slots=True)
class _Clock:
    """Seconds since the vehicle's first boot in the log; a restart goes on in the ground's time.

    `first_heard_s` and `last_heard_s` are in the ground's time too.
    """

    now_s: float = -np.inf
    restarts: list[Event] = field(default_factory=list)
    first_heard_s: float = np.inf
    last_heard_s: float = 0.0
    _ahead_s: float = 0.0
    zero_s: float = np.inf
    """The ground's time at 0 s, once its clock is set."""

    def at(self, boot_ms: float, stamp_s: float) -> float:
        time_s, elapsed_s = boot_ms / 1000 + self._ahead_s, stamp_s - self.last_heard_s
        has_just_booted = boot_ms / 1000 <= elapsed_s + _SHORTEST_BOOT_S
        if time_s < self.now_s - (_SHORTEST_BOOT_S if has_just_booted else _BACK_S):
            self._ahead_s += self.now_s + min(max(elapsed_s, _SHORTEST_BOOT_S), _LONGEST_OFF_S) - time_s
            time_s = boot_ms / 1000 + self._ahead_s
            self.restarts.append(Event(EventKind.BOOT, time_s, "the vehicle restarting"))
        self.now_s, self.last_heard_s = max(self.now_s, time_s), stamp_s
        self.first_heard_s = min(self.first_heard_s, stamp_s)
        if stamp_s >= CLOCK_SET_S and self.zero_s > stamp_s:
            self.zero_s = stamp_s - time_s
        return time_s


@dataclass(slots=True)
class _Decoder:
    """Messages of ground stations and the vehicle, in order of receipt."""

    vehicle: Vehicle
    _gains: Mapping[str, GainParameter] = field(init=False)
    _clock: _Clock = field(default_factory=_Clock)
    _reports: "defaultdict[str, array[float]]" = field(default_factory=lambda: defaultdict(lambda: array("d")))
    _blocks: dict[int, str] = field(default_factory=dict)
    _activated: list[tuple[float, int]] = field(default_factory=list)
    _entered: list[tuple[float, int]] = field(default_factory=list)
    _settings: list[Setting] = field(default_factory=list)
    _known: set[str] = field(default_factory=set)
    _written: set[str] = field(default_factory=set)
    _parameters: int = 0
    _asked: dict[str, float] = field(default_factory=dict)
    _sent: dict[int, Event] = field(default_factory=dict)
    _events: list[Event] = field(default_factory=list)
    _arming: list[tuple[float, bool]] = field(default_factory=list)
    _heard_s: float = -np.inf
    _mode: int | None = None
    _release: str = ""
    _hardware_id: str = ""
    _is_fed: bool = False
    """Whether the last position target for it has more than a position, which it does not report."""

    def __post_init__(self) -> None:
        self._gains = {gain.parameter: gain for gains in self.vehicle.autopilot.gain_sets for gain in gains}

    def recording(self, decoders: Sequence["_Decoder"]) -> Recording:
        """What was read so far; `decoders` are those of all vehicles in the log."""
        autopilot = self.vehicle.autopilot
        self._events.extend(self._sent.values())  # a command without an answer counts as accepted
        for time_s, number in self._activated:
            name = self._blocks.get(number, "")
            takes_off = "takeoff" in name.casefold().replace(" ", "").replace("_", "")
            what = f"the block {name}" if name else f"block {number}"
            self._events.append(Event(EventKind.TAKEOFF if takes_off else EventKind.COMMAND, time_s, what))
        tables = {name: _table(name, values) for name, values in self._reports.items()}
        sources = SOURCES if self.vehicle.has_own_frame else {**SOURCES, **_ABOVE_HOME}
        return Recording(
            title=f"MAVLink log of {autopilot.project or autopilot.title}, altitude from {sources['altitude_m']}",
            autopilot=autopilot,
            system=self.vehicle.system,
            release=self._release,
            hardware_id=self._hardware_id,
            frame=self.vehicle.frame,
            started_at=date_of(self._clock.zero_s),
            heard_s=self._clock.first_heard_s,
            columns=columns_of(tables, sources, clock=_TIME, ticks_per_s=1.0),
            sources=list(tables),
            settings=self._settings,
            has_all_parameters=0 < self._parameters <= len(self._known),
            events=[*self._events, *self._clock.restarts],
            armed=spans_of(self._arming) or None,
            blocks=list(self._commanded_blocks()),
            notes=[
                *(self._beside(each) for each in decoders if each is not self),
                *restarts(len(self._clock.restarts)),
                *(
                    f"{name} was set to {value:g}, but the vehicle never confirmed it"
                    for name, value in self._asked.items()
                ),
            ],
        )

    def _beside(self, other: "_Decoder") -> str:
        """The note on another vehicle in the log."""
        project = other.vehicle.autopilot.project or other.vehicle.autopilot.title
        clocks = self._clock, other._clock
        gone_s, came_s = min(each.last_heard_s for each in clocks), max(each.first_heard_s for each in clocks)
        same = (
            "; never heard together with this one: the same if its system id was changed"
            if gone_s <= came_s + _APART_S
            else ""
        )
        return f"another vehicle in the log, system {other.vehicle.system} under {project}{same}"

    def _report(self, message: Message, *values: float) -> None:
        """Take a report, dated by its own time, or else by the last one; before the first time, states alone."""
        has_time = "time_boot_ms" in message.fields
        time_s = self._clock.at(message["time_boot_ms"], message.stamp_s) if has_time else self._clock.now_s
        if np.isfinite(time_s) or message.name == "HEARTBEAT":
            self._reports[message.name].extend((time_s, *values))

    def _heartbeat(self, message: Message) -> None:
        if not self.vehicle.sends(message):
            return
        is_armed, mode, now_s = bool(int(message["base_mode"]) & _ARMED), int(message["custom_mode"]), self._clock.now_s
        was_armed = bool(self._arming) and self._arming[-1][1]
        if was_armed and not is_armed:
            self._events.append(Event(EventKind.MOTORS_OFF, now_s, "motors off"))
        if was_armed and self._mode != mode:
            self._mode_changed(mode)
        self._arming.append((self._heard_s if is_armed else now_s, is_armed))  # it armed since the heartbeat before
        self._mode, self._heard_s = mode, now_s
        self._report(message, float(is_armed), float(mode))

    def _mode_changed(self, mode: int) -> None:
        main, sub = mode >> 16 & 0xFF, mode >> 24 & 0xFF
        if not self.vehicle.autopilot.hovering_modes or main != 4 or sub not in (_PX4_TAKEOFF_MODE, _PX4_HOVER_MODE):
            self._events.append(Event(EventKind.MODE, self._clock.now_s, f"mode {sub or mode}"))
        elif sub == _PX4_TAKEOFF_MODE:
            self._events.append(Event(EventKind.TAKEOFF, self._clock.now_s, "takeoff mode"))

    def _as_it_is(self, message: Message) -> None:
        self._report(message, *(message[field] for field in _FIELDS[message.name]))

    def _attitude_target(self, message: Message) -> None:
        x, y, thrust = message["q[1]"], message["q[2]"], message["thrust"]
        lean = 1.0 if int(message["type_mask"]) & _IGNORES_ATTITUDE else 1.0 - 2.0 * (x * x + y * y)
        self._report(message, thrust if 0.0 <= thrust <= 1.0 else np.nan, lean)

    def _position_target(self, message: Message) -> None:
        is_unknown = self._is_fed or int(message["type_mask"]) & _IGNORES_Z or not self.vehicle.has_own_frame
        self._report(message, np.nan if is_unknown else message["z"])

    def _position_above_home(self, message: Message) -> None:
        if not self.vehicle.has_own_frame:
            self._as_it_is(message)

    def _battery(self, message: Message) -> None:
        if 0 < message["voltage_battery"] < 0xFFFF:
            self._report(message, message["voltage_battery"] / 1000)

    def _throttle(self, message: Message) -> None:
        if 0 <= message["throttle"] <= 100:
            self._report(message, message["throttle"] / 100)

    def _version(self, message: Message) -> None:
        self._release = release_of(int(message["flight_sw_version"])) or self._release
        if self.vehicle.autopilot.sends_hardware_id:
            uid2 = bytes(int(message[f"uid2[{place}]"]) for place in range(UID2_BYTES))
            self._hardware_id = self._hardware_id or hardware_id(uid_of(message.payload[_UID], uid2))

    def _parameter(self, message: Message) -> None:
        bytewise = self.vehicle.autopilot.sends_integers_bytewise and int(message["param_type"]) in _INTEGERS
        value = float(struct.unpack("<i", message.payload[:4])[0]) if bytewise else message["param_value"]
        name = self._name(message)
        if name in ("kil_thr", "aut_kil_thr") and value:
            self._events.append(Event(EventKind.MOTORS_OFF, self._clock.now_s, "motors off"))
        is_first = name not in self._known and name not in self._written
        self._known.add(name)
        self._parameters = int(message["param_count"])
        if np.isfinite(value):
            self._settings.append(Setting(self._clock.now_s, name, value, held_before=is_first))
            if self._asked.get(name) == value:
                del self._asked[name]

    def _name(self, message: Message) -> str:
        """The parameter, by its name in recordings."""
        name = message.text("param_id")
        return self._gains[name].gain if self.vehicle.autopilot.logs_own_names and name in self._gains else name

    def _parameter_asked(self, message: Message) -> None:
        name, value, gain = self._name(message), message["param_value"], self._gains.get(message.text("param_id"))
        self._written.add(name)
        if gain is not None and message.system != self.vehicle.system and np.isfinite(value):
            self._asked[name] = float(int(value)) if gain.whole else value

    def _position_asked(self, message: Message) -> None:
        if message["target_system"] == self.vehicle.system:
            given = ((message["vz"], _IGNORES_VZ), (message["afz"], _IGNORES_AZ))
            mask = int(message["type_mask"])
            self._is_fed = any(abs(value) > 0.0 and not mask & ignored for value, ignored in given)

    def _mode_asked(self, _message: Message) -> None:
        self._events.append(Event(EventKind.COMMAND, self._clock.now_s, "SET_MODE"))

    def _command(self, message: Message) -> None:
        number = int(message["command"])
        takes_off = number == _TAKEOFF or (
            number == _SET_MODE and self.vehicle.autopilot.hovering_modes and message["param3"] == _PX4_TAKEOFF_MODE
        )
        if number in _COMMANDS and not (number == _MOTORS and message["param1"]):
            kind = EventKind.TAKEOFF if takes_off else EventKind.COMMAND
            self._sent[number] = Event(kind, self._clock.now_s, f"the command {_COMMANDS[number]}")

    def _answer(self, message: Message) -> None:
        sent = self._sent.pop(int(message["command"]), None)
        if sent is not None and message["result"] in _ACCEPTED:
            self._events.append(sent)

    def _block(self, message: Message) -> None:
        self._blocks[int(message["seq"])] = message.text("name")

    def _block_asked(self, message: Message) -> None:
        self._activated.append((self._clock.now_s, int(message["seq"])))

    def _block_entered(self, message: Message) -> None:
        self._entered.append((self._clock.now_s, int(message["seq"])))

    def _commanded_blocks(self) -> Iterator[Span]:
        """Every stay in a block that the vehicle entered on command, from the command to that of another one."""
        before_s = -np.inf
        for entered_s, number in self._entered:
            sent_s = [at_s for at_s, sent in self._activated if sent == number and before_s < at_s <= entered_s]
            others_s = (at_s for at_s, other in (*self._entered, *self._activated) if other != number)
            if sent_s:
                yield Span(sent_s[-1], min((at_s for at_s in others_s if at_s >= entered_s), default=np.inf))
            before_s = entered_s


def _table(message: str, reports: "array[float]") -> Table:
    names = (_TIME, *_FIELDS[message])
    return dict(zip(names, np.array(reports).reshape(-1, len(names)).T, strict=True))


_Handlers = Mapping[str, Callable[[_Decoder, Message], None]]

_REPORTS: Final[_Handlers] = {
    "HEARTBEAT": _Decoder._heartbeat,
    "LOCAL_POSITION_NED": _Decoder._as_it_is,
    "GLOBAL_POSITION_INT": _Decoder._position_above_home,
    "ATTITUDE_TARGET": _Decoder._attitude_target,
    "POSITION_TARGET_LOCAL_NED": _Decoder._position_target,
    "NAV_CONTROLLER_OUTPUT": _Decoder._as_it_is,
    "SYS_STATUS": _Decoder._battery,
    "VFR_HUD": _Decoder._throttle,
    "AUTOPILOT_VERSION": _Decoder._version,
    "PARAM_VALUE": _Decoder._parameter,
    "COMMAND_ACK": _Decoder._answer,
    "SCRIPT_ITEM": _Decoder._block,
    "SCRIPT_CURRENT": _Decoder._block_entered,
}
_REQUESTS: Final[_Handlers] = {
    "PARAM_SET": _Decoder._parameter_asked,
    "SET_POSITION_TARGET_LOCAL_NED": _Decoder._position_asked,
    "SET_MODE": _Decoder._mode_asked,
    "COMMAND_INT": _Decoder._command,
    "COMMAND_LONG": _Decoder._command,
    "SCRIPT_ITEM": _Decoder._block_asked,
}
