"""Takeoffs in ArduPilot's on-board logs (.bin)."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.takeoffs import FlightLog, LogEvent, Setting
from app.core.records.trajectory import Samples
from app.logs.base import ARDUPILOT_SETS, Table, contents, names_in, numbers, refused, rows_of
from app.logs.dataflash import parameters_in, read_tables, seconds

_TAKEOFF, _LAND = 22, 21
_ACCEPTED: Final = (0, 5)
_LANDINGS: Final[Mapping[float, str]] = MappingProxyType({11: "motors off", 18: "the landing"})
_MODES: Final[Mapping[float, str]] = MappingProxyType(
    {0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND", 16: "POSHOLD"}
)

_WANTED: Final = frozenset({"PSCD", "CTUN", "PARM", "MODE", "MAVC", "EV", "BAT"})
_HINT: Final = "Use ArduPilot's .bin log of the flight, recorded with control tuning in LOG_BITMASK (PSCD, CTUN)."


def read_dataflash(stream: BinaryIO) -> FlightLog:
    """Read a whole log. Raises TrajectoryError if it contains no altitude."""
    tables = read_tables(contents(stream), _WANTED)
    time_s, channels, title = _altitude(tables)
    if "BAT" in tables and {"TimeUS", "Volt"} <= tables["BAT"].keys():
        battery = _first_instance(tables["BAT"])
        if len(battery["TimeUS"]):
            channels["battery_v"] = np.interp(time_s, seconds(battery), numbers(battery["Volt"]))
    starts, ends, landings = _moments(tables)
    return FlightLog(
        title=f"ArduPilot's on-board log, {title}",
        clock="vehicle",
        time_s=time_s,
        channels=channels,
        from_ground=True,
        gain_sets=ARDUPILOT_SETS,
        settings=tuple(_settings(tables)),
        starts=starts,
        ends=[*ends, *landings],
        landings=landings,
    )


def _altitude(tables: Mapping[str, Table]) -> tuple[Samples, dict[str, Samples], str]:
    """Time, channels, and their source: the vertical controller's own message if it is logged."""
    loop, tuning = tables.get("PSCD", {}), tables.get("CTUN", {})
    if {"TimeUS", "PD"} <= loop.keys():
        time_s = seconds(loop)
        down = {"altitude_m": "PD", "reference_m": "TPD", "climb_rate_m_s": "VD"}
        channels = {channel: -numbers(loop[name]) for channel, name in down.items() if name in loop}
        title = "altitude from PSCD.PD"
    elif {"TimeUS", "Alt"} <= tuning.keys():
        time_s = seconds(tuning)
        up = {"altitude_m": "Alt", "reference_m": "DAlt"}
        channels = {channel: numbers(tuning[name]) for channel, name in up.items() if name in tuning}
        title = "altitude from CTUN.Alt"
    else:
        raise refused("contains neither PSCD.PD nor CTUN.Alt, the altitude", _HINT)
    if {"TimeUS", "ThO"} <= tuning.keys() and len(tuning["TimeUS"]):
        channels["thrust"] = np.interp(time_s, seconds(tuning), numbers(tuning["ThO"]))
    return time_s, channels, title


def _settings(tables: Mapping[str, Table]) -> Iterator[Setting]:
    """The gains, logged at the start of the log and at every change."""
    names = names_in(ARDUPILOT_SETS)
    for time_s, name, value in parameters_in(tables):
        if name in names and np.isfinite(value):
            yield Setting(time_s, name, value)


def _moments(tables: Mapping[str, Table]) -> tuple[list[LogEvent], list[LogEvent], list[LogEvent]]:
    """Takeoff commands, events that end the flight, and landings."""
    accepted = [
        (time_s, command)
        for time_s, command, result in rows_of(tables.get("MAVC", {}), "TimeUS", "Cmd", "Res")
        if result in _ACCEPTED
    ]
    starts = [LogEvent(time_s, "the command NAV_TAKEOFF") for time_s, command in accepted if command == _TAKEOFF]
    ends = [LogEvent(time_s, "the command NAV_LAND") for time_s, command in accepted if command == _LAND]
    modes = list(rows_of(tables.get("MODE", {}), "TimeUS", "ModeNum"))
    ends += [
        LogEvent(time_s, f"the mode {_MODES.get(mode, f'{mode:g}')}")
        for (_, before), (time_s, mode) in pairwise(modes)
        if mode != before
    ]
    landings = [
        LogEvent(time_s, _LANDINGS[event])
        for time_s, event in rows_of(tables.get("EV", {}), "TimeUS", "Id")
        if event in _LANDINGS
    ]
    return starts, ends, landings


def _first_instance(table: Table) -> Table:
    """The first battery, if there are several."""
    instance = next((table[name] for name in ("Inst", "Instance") if name in table), None)
    return table if instance is None else {name: values[numbers(instance) == 0] for name, values in table.items()}
