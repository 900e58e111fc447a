"""ArduPilot's on-board log (.bin) to a `Recording`: which message and column means what."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.ardupilot.profile import ARDUPILOT
from app.autopilots.ardupilot.replica.parameters import in_older_names
from app.autopilots.recording import (
    COMMANDS,
    Event,
    EventKind,
    ParameterHistory,
    Recording,
    Setting,
    Source,
    columns_of,
    restarts,
)
from app.logs.base import Table, contents, numbers, rows_of
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
TERMS: Final = ("P", "I", "D", "FF", "DFF")
"""Of the acceleration controller, in ‰ of throttle."""
NOT_POSITION: Final = ("Terrain", "vX", "vY", "vZ", "aX", "aY", "aZ")
"""Columns of a target in GUIDED, beside the altitude."""
_BESIDE: Final[Mapping[str, Source]] = {
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
_WITHOUT_LOOP: Final = {"altitude_m": Source("CTUN", "Alt"), "reference_m": Source("CTUN", "DAlt")}
_WANTED: Final = frozenset(
    {"PARM", "MAVC", "EV", "MSG", "PSCZ", *(each.message for each in (*LOOP.values(), *_BESIDE.values()))}
)

_ACCEPTED: Final = (0, 5)
_EVENTS: Final[Mapping[float, tuple[EventKind, str]]] = MappingProxyType(
    {
        11: (EventKind.MOTORS_OFF, "motors off"),
        18: (EventKind.LANDING, "the landing"),
        28: (EventKind.LIFT_OFF, "lift-off"),
    }
)
MODES: Final[Mapping[float, str]] = MappingProxyType(
    {0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND", 16: "POSHOLD"}
)
_OTHER_FIRMWARE: Final = re.compile(rb"(ArduPlane|ArduRover|Rover|ArduSub|Blimp|AntennaTracker) V\d")


def read_ardupilot(stream: BinaryIO) -> Recording:
    """Decode a whole log."""
    log = read_tables(contents(stream), _WANTED)
    tables = log.tables | {name: _only(log.tables[name], *which) for name, which in _ROWS.items() if name in log.tables}
    has_loop = {"TimeUS", "PD"} <= tables.get("PSCD", {}).keys()
    columns = columns_of(tables, {**LOOP, **_BESIDE, **({} if has_loop else _WITHOUT_LOOP)}, clock="TimeUS")
    altitude = columns["altitude_m"].source if "altitude_m" in columns else "nothing"
    return Recording(
        title=f"ArduPilot's on-board log, altitude from {altitude}",
        autopilot=ARDUPILOT,
        firmware=_other_firmware(tables),
        columns=columns,
        sources=list(tables),
        settings=[Setting(*each) for each in parameters_in(tables) if np.isfinite(each[2])],
        events=sorted(_events(tables, log.boots_s), key=lambda event: event.time_s),
        notes=restarts(len(log.boots_s)),
    )


def history(recording: Recording, names: frozenset[str]) -> ParameterHistory:
    """Of the parameters with these names until release 4.6, whichever release it is."""
    logged = ((each.time_s, *in_older_names(each.name, each.value)) for each in recording.settings)
    return ParameterHistory.of(each for each in logged if each[1] in names)


def _events(tables: Mapping[str, Table], boots_s: Sequence[float]) -> Iterator[Event]:
    """Takeoff commands, events that end the flight, and landings."""
    yield from (Event(EventKind.BOOT, boot_s, "the vehicle restarting") for boot_s in boots_s)
    for time_s, command, result in rows_of(tables.get("MAVC", {}), "TimeUS", "Cmd", "Res"):
        if result in _ACCEPTED and command in COMMANDS:
            kind, what = COMMANDS[command]
            yield Event(kind, time_s, what)
    modes = list(rows_of(tables.get("MODE", {}), "TimeUS", "ModeNum"))
    for (_, before), (time_s, mode) in pairwise(modes):
        if mode != before:
            yield Event(EventKind.MODE, time_s, f"the mode {MODES.get(mode, f'{mode:g}')}")
    for time_s, event in rows_of(tables.get("EV", {}), "TimeUS", "Id"):
        if event in _EVENTS:
            yield Event(_EVENTS[event][0], time_s, _EVENTS[event][1])


def _only(table: Table, columns: Collection[str], value: int) -> Table:
    """Rows with this value in the first of the columns that it has."""
    found = next((numbers(table[each]) for each in columns if each in table), None)
    return table if found is None else {name: values[found == value] for name, values in table.items()}


def _other_firmware(tables: Mapping[str, Table]) -> str:
    """The firmware of another kind of vehicle that tells its version in a message; empty if none does."""
    messages = tables.get("MSG", {}).get("Message", np.empty(0, "S64")).tolist()
    found = (_OTHER_FIRMWARE.match(each) for each in messages if isinstance(each, bytes))
    return next((each[1].decode() for each in found if each), "")
