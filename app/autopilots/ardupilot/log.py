"""ArduPilot's on-board log (.bin) to a `Recording`: which message and column means what."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.recording import (
    Event,
    EventKind,
    GainSets,
    LoggedGain,
    Recording,
    Setting,
    Source,
    columns_of,
    names_in,
    own_names,
)
from app.core.control.ardupilot_parameters import GAINS, NEWER_NAMES
from app.logs.base import Table, contents, numbers, rows_of
from app.logs.dataflash import parameters_in, read_tables

GAIN_SETS: Final[GainSets] = (
    own_names(*GAINS),
    tuple(LoggedGain(newer, older, 1.0 / factor) for newer, (older, factor) in NEWER_NAMES.items() if older in GAINS),
)
"""Until 4.6, and from 4.7 on."""

_COMMANDS: Final[Mapping[float, tuple[EventKind, str]]] = MappingProxyType(
    {22: (EventKind.TAKEOFF, "NAV_TAKEOFF"), 21: (EventKind.COMMAND, "NAV_LAND")}
)
_ACCEPTED: Final = (0, 5)
_EVENTS: Final[Mapping[float, tuple[EventKind, str]]] = MappingProxyType(
    {11: (EventKind.MOTORS_OFF, "motors off"), 18: (EventKind.LANDING, "the landing")}
)
_MODES: Final[Mapping[float, str]] = MappingProxyType(
    {0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND", 16: "POSHOLD"}
)

_WANTED: Final = frozenset({"PSCD", "CTUN", "PARM", "MODE", "MAVC", "EV", "BAT"})
_COMMON: Final = {"thrust": Source("CTUN", "ThO"), "battery_v": Source("BAT", "Volt")}
_FROM_LOOP: Final = {
    "altitude_m": Source("PSCD", "PD", -1.0),
    "reference_m": Source("PSCD", "TPD", -1.0),
    "climb_rate_m_s": Source("PSCD", "VD", -1.0),
    **_COMMON,
}
_FROM_TUNING: Final = {"altitude_m": Source("CTUN", "Alt"), "reference_m": Source("CTUN", "DAlt"), **_COMMON}


def read_ardupilot(stream: BinaryIO) -> Recording:
    """Decode a whole log."""
    tables = read_tables(contents(stream), _WANTED)
    sources = _FROM_LOOP if {"TimeUS", "PD"} <= tables.get("PSCD", {}).keys() else _FROM_TUNING
    if "BAT" in tables:
        tables["BAT"] = _first_instance(tables["BAT"])
    columns = columns_of(tables, sources, clock="TimeUS")
    altitude = columns["altitude_m"].source if "altitude_m" in columns else "nothing"
    return Recording(
        title=f"ArduPilot's on-board log, altitude from {altitude}",
        clock="vehicle",
        columns=columns,
        from_ground=True,
        gain_sets=GAIN_SETS,
        settings=tuple(_settings(tables)),
        events=list(_events(tables)),
    )


def _settings(tables: Mapping[str, Table]) -> Iterator[Setting]:
    """The gains, logged at the start of the log and at every change."""
    names = names_in(GAIN_SETS)
    for time_s, name, value in parameters_in(tables):
        if name in names and np.isfinite(value):
            yield Setting(time_s, name, value)


def _events(tables: Mapping[str, Table]) -> Iterator[Event]:
    """Takeoff commands, events that end the flight, and landings."""
    for time_s, command, result in rows_of(tables.get("MAVC", {}), "TimeUS", "Cmd", "Res"):
        if result in _ACCEPTED and command in _COMMANDS:
            yield Event(_COMMANDS[command][0], time_s, f"the command {_COMMANDS[command][1]}")
    modes = list(rows_of(tables.get("MODE", {}), "TimeUS", "ModeNum"))
    for (_, before), (time_s, mode) in pairwise(modes):
        if mode != before:
            yield Event(EventKind.MODE, time_s, f"the mode {_MODES.get(mode, f'{mode:g}')}")
    for time_s, event in rows_of(tables.get("EV", {}), "TimeUS", "Id"):
        if event in _EVENTS:
            yield Event(_EVENTS[event][0], time_s, _EVENTS[event][1])


def _first_instance(table: Table) -> Table:
    """The first battery, if there are several."""
    instance = next((table[name] for name in ("Inst", "Instance") if name in table), None)
    return table if instance is None else {name: values[numbers(instance) == 0] for name, values in table.items()}
