"""ArduPilot's on-board log (.bin) to a `Recording`: which message and column means what."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.ardupilot.profile import ARDUPILOT
from app.autopilots.ardupilot.replica.parameters import in_older_names
from app.autopilots.mavlink import UID2_BYTES, hardware_id
from app.autopilots.recording import (
    COMMANDS,
    Column,
    Event,
    EventKind,
    ParameterHistory,
    Recording,
    Setting,
    Source,
    columns_of,
    date_of,
    left_out,
    restarts,
)
from app.core.reasons import Reason, ReasonCode, refusal
from app.core.records.trajectory import Samples
from app.logs.base import Table, contents, numbers, rows_of
from app.logs.boots import CLOCK
from app.logs.dataflash import parameters_in, read_tables

LOOP: Final[Mapping[str, Source]] = {
    "altitude_m": Source("PSCD", "PD", -1.0),
    "climb_rate_m_s": Source("PSCD", "VD", -1.0),
    "acceleration_m_s2": Source("PSCD", "AD", -1.0),
    "desired_climb_rate_m_s": Source("PSCD", "DVD", -1.0),
    "desired_acceleration_m_s2": Source("PSCD", "DAD", -1.0),
    "climb_rate_target_m_s": Source("PSCD", "TVD", -1.0),
    "desired_altitude_m": Source("PSCD", "DPD", -1.0),
    "reference_m": Source("PSCD", "TPD", -1.0),
}
"""The vertical controller's own message. The desired motion is shaped: releases before 4.6 log its altitude as the
reference."""
UPWARD: Final[Mapping[str, Source]] = {
    "altitude_m": Source("PSCZ", "PZ"),
    "climb_rate_m_s": Source("PSCZ", "VZ"),
    "acceleration_m_s2": Source("PSCZ", "AZ"),
    "desired_climb_rate_m_s": Source("PSCZ", "DVZ"),
    "desired_acceleration_m_s2": Source("PSCZ", "DAZ"),
    "climb_rate_target_m_s": Source("PSCZ", "TVZ"),
    "reference_m": Source("PSCZ", "TPZ"),
}
"""The same in release 4.1, positive up."""
TUNING: Final[Mapping[str, Source]] = {
    "altitude_m": Source("CTUN", "Alt"),
    "climb_rate_m_s": Source("CTUN", "CRt", 0.01),
    "acceleration_m_s2": Source("RATE", "A", 0.01),
    "climb_rate_target_m_s": Source("CTUN", "DCRt", 0.01),
    "reference_m": Source("CTUN", "DAlt"),
}
"""What releases before 4.1 log of it, 3.4 and later completely. The reference is 0 where the loop is not in control."""
LOOPS: Final = (LOOP, UPWARD, TUNING)
TERMS: Final = ("P", "I", "D", "FF", "DFF")
"""Of the acceleration controller, in ‰ of throttle."""
NOT_POSITION: Final = ("Terrain", "vX", "vY", "vZ", "aX", "aY", "aZ")
"""Columns of a target in GUIDED, beside the altitude."""
BESIDE: Final[Mapping[str, Source]] = {
    "demanded_throttle": Source("CTUN", "ThI"),
    "thrust": Source("CTUN", "ThO"),
    "hover_throttle": Source("CTUN", "ThH"),
    "roll_deg": Source("ATT", "Roll"),
    "pitch_deg": Source("ATT", "Pitch"),
    "mode": Source("MODE", "ModeNum", holds_s=np.inf),
    "target_altitude_m": Source("GUIP", "pZ", holds_s=np.inf),
    **{f"target_{each}": Source("GUIP", each, holds_s=np.inf) for each in NOT_POSITION},
    **{f"control_{each}": Source("PIDA", each) for each in (*TERMS, "Flags")},
    "battery_v": Source("BAT", "Volt"),
    "vibration_failsafe": Source("ERR", "ECode", holds_s=np.inf),
}
_ROWS: Final[Mapping[str, tuple[Collection[str], int]]] = {"BAT": (("Inst", "Instance"), 0), "ERR": (("Subsys",), 29)}
"""The first battery, and the failsafe for vibration, which replaces the loop."""
_UNTIL_3_3: Final[Mapping[str, Source]] = {"thrust": Source("CTUN", "ThrOut", 0.001)}
_WANTED: Final = frozenset(
    {"PARM", "MAVC", "EV", "MSG", "GPS", *(each.message for part in (*LOOPS, BESIDE) for each in part.values())}
)

_ACCEPTED: Final = (0, 5)
_EVENTS: Final[Mapping[float, tuple[EventKind, str]]] = MappingProxyType(
    {
        10: (EventKind.MOTORS_ON, "motors on"),
        11: (EventKind.MOTORS_OFF, "motors off"),
        18: (EventKind.LANDING, "the landing"),
        28: (EventKind.LIFT_OFF, "lift-off"),
    }
)
MODES: Final[Mapping[float, str]] = MappingProxyType(
    {0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND", 16: "POSHOLD"}
)
_MODES_AS_TEXT: Final = {
    name.upper().replace("_", "").replace(" ", "").encode(): float(number)
    for number, name in ARDUPILOT.mode_names.items()
}
_UNTIL_RESTART: Final = ("mode", "vibration_failsafe")
"""States that a vehicle that starts anew reports only as they change."""
_NO_CLOCK_HINT: Final = "Releases of ArduCopter before 3.1 log no time: use a log of a newer one."
_BANNER: Final = re.compile(
    rb"(APM:Copter|ArduCopter|ArduPlane|ArduRover|Rover|ArduSub|Blimp|AntennaTracker) V(\d[\w.-]*)"
)
_FRAME: Final = re.compile(rb"Frame: ([\w/-]+)")
_BOARD: Final = re.compile(rb"(?i)[^ ].* ([\da-f]{8}) ([\da-f]{8}) ([\da-f]{8})\s*$")
"""The board's name and the words of its id; in a simulation there is one word of another form."""
_WEEK_S: Final = 604_800.0
_GPS_BEGAN_S: Final = datetime(1980, 1, 6, tzinfo=UTC).timestamp() - 18.0
"""Less the leap seconds since then."""
_COPTERS: Final = ("APM:Copter", "ArduCopter")


def read_ardupilot(stream: BinaryIO) -> Recording:
    """Decode a whole log, binary or as text. Raises TrajectoryError if no message in it has the time."""
    log = read_tables(contents(stream), _WANTED)
    if log.tables and not any(CLOCK in table for table in log.tables.values()):
        raise refusal("This file cannot be read as a flight.", _NO_CLOCK_HINT, [Reason(code=ReasonCode.NO_CLOCK)])
    tables = log.tables | {name: _only(log.tables[name], *which) for name, which in _ROWS.items() if name in log.tables}
    tables["MODE"] = _with_numbers(tables.get("MODE", {}))
    sources = {name: _in_si(each, log.factors) for name, each in {**BESIDE, **_loop(tables)}.items()}
    columns = columns_of(tables, _UNTIL_3_3, clock=CLOCK) | columns_of(tables, sources, clock=CLOCK)
    if (found := columns.get("reference_m")) is not None and found.source == str(TUNING["reference_m"]):
        columns["reference_m"] = replace(found, values=np.where(found.values == 0.0, np.nan, found.values))
    columns |= {name: _until_restart(columns[name], log.boots_s) for name in _UNTIL_RESTART if name in columns}
    altitude = columns["altitude_m"].source if "altitude_m" in columns else "nothing"
    firmware, release = _in_messages(tables, _BANNER)
    return Recording(
        title=f"ArduPilot's on-board log, altitude from {altitude}",
        autopilot=ARDUPILOT,
        firmware="" if firmware in _COPTERS else firmware,
        release=release,
        frame=_in_messages(tables, _FRAME)[0],
        hardware_id=_hardware_id(_in_messages(tables, _BOARD)),
        columns=columns,
        sources=list(log.tables),
        settings=[Setting(*each) for each in parameters_in(tables) if np.isfinite(each[2])],
        events=sorted(_events(tables, log.boots_s), key=lambda event: event.time_s),
        notes=[*restarts(len(log.boots_s)), *left_out(log.skipped_bytes, log.odd_rows)],
        started_at=None if log.boots_s else date_of(_booted_s(tables)),
    )


def _hardware_id(words: Sequence[str]) -> str:
    """The board's id from its words, each of which is printed with the last byte first; as long as in MAVLink 2."""
    serial = b"".join(bytes.fromhex(each)[::-1] for each in words)
    return hardware_id(serial.ljust(UID2_BYTES, b"\0").hex())


def _booted_s(tables: Mapping[str, Table]) -> float:
    """Time since 1970 at 0 s, by the GPS, whose time is ahead of UTC by leap seconds; 0 if it had none."""
    fixes = rows_of(tables.get("GPS", {}), CLOCK, "GWk", "GMS")
    return next((_GPS_BEGAN_S + week * _WEEK_S + ms / 1e3 - at_s for at_s, week, ms in fixes if week > 0.0), 0.0)


def history(recording: Recording, names: frozenset[str]) -> ParameterHistory:
    """Of the parameters with these names until release 4.6, whichever release it is."""
    logged = ((each.time_s, *in_older_names(each.name, each.value)) for each in recording.settings)
    return ParameterHistory.of(each for each in logged if each[1] in names)


def _events(tables: Mapping[str, Table], boots_s: Sequence[float]) -> Iterator[Event]:
    """Takeoff commands, events that end the flight, and landings."""
    yield from (Event(EventKind.BOOT, boot_s, "the vehicle restarting") for boot_s in boots_s)
    for time_s, command, result in rows_of(tables.get("MAVC", {}), CLOCK, "Cmd", "Res"):
        if result in _ACCEPTED and command in COMMANDS:
            kind, what = COMMANDS[command]
            yield Event(kind, time_s, what)
    modes = list(rows_of(tables.get("MODE", {}), CLOCK, "ModeNum"))
    for (_, before), (time_s, mode) in pairwise(modes):
        if mode != before and np.isfinite(mode):
            yield Event(EventKind.MODE, time_s, f"the mode {MODES.get(mode, f'{mode:g}')}")
    for time_s, event in rows_of(tables.get("EV", {}), CLOCK, "Id"):
        if event in _EVENTS:
            yield Event(_EVENTS[event][0], time_s, _EVENTS[event][1])


def _loop(tables: Mapping[str, Table]) -> Mapping[str, Source]:
    """Where the loop is from: its own message, unless that lacks most of the time in which it flies."""
    reference, thrust = (_values(each, tables) for each in (TUNING["reference_m"], BESIDE["thrust"]))
    controlled = np.count_nonzero(reference * thrust) if len(reference) == len(thrust) else 0
    own = (each for each in (LOOP, UPWARD) if 2 * len(_values(each["altitude_m"], tables)) > controlled)
    return next(own, TUNING)


def _values(source: Source, tables: Mapping[str, Table]) -> Samples:
    """All values of a field; none if it was not logged."""
    return numbers(tables.get(source.message, {}).get(source.field, np.empty(0)))


def _in_si(source: Source, factors: Mapping[str, Mapping[str, float]]) -> Source:
    """The source of values in SI, by the factor that the log tells, or else by that of the releases that do not."""
    given = factors.get(source.message, {}).get(source.field)
    return source if given is None else replace(source, factor=np.copysign(given, source.factor))


def _until_restart(column: Column, boots_s: Sequence[float]) -> Column:
    """A state that nothing is known of after a restart, until it is reported again."""
    rows = np.searchsorted(column.time_s, boots_s)
    time_s, values = np.insert(column.time_s, rows, boots_s), np.insert(column.values, rows, np.nan)
    return replace(column, time_s=time_s, values=values)


def _with_numbers(modes: Table) -> Table:
    """Modes by number, which old releases log as the mode itself, and logs as text by its name."""
    if "ModeNum" in modes or "Mode" not in modes:
        return modes
    texts = [each.upper().replace(b"_", b"") for each in modes["Mode"].astype("S16").tolist()]
    found = [float(each) if each.isdigit() else _MODES_AS_TEXT.get(each, np.nan) for each in texts]
    return {**modes, "ModeNum": np.array(found)}


def _only(table: Table, columns: Collection[str], value: int) -> Table:
    """Rows with this value in the first of the columns that it has."""
    found = next((numbers(table[each]) for each in columns if each in table), None)
    return table if found is None else {name: values[found == value] for name, values in table.items()}


def _in_messages(tables: Mapping[str, Table], pattern: re.Pattern[bytes]) -> list[str]:
    """What the first message that matches a pattern tells by its groups; empty texts if none does."""
    messages = tables.get("MSG", {}).get("Message", np.empty(0, "S64")).tolist()
    matches = (pattern.match(each) for each in messages if isinstance(each, bytes))
    return next(([text.decode() for text in each.groups()] for each in matches if each), [""] * pattern.groups)
