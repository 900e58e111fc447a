"""Reader of the vertical loop in ArduPilot's on-board log (.bin): PSCD, PIDA, CTUN, GUIP, MODE and the parameters."""

from collections.abc import Callable, Mapping
from itertools import groupby
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.ardupilot_log import LoopLog
from app.core.control.ardupilot_parameters import (
    FIRMWARE_NAMES,
    LOOP_RATE,
    LOOP_RATE_HZ,
    LOOP_RATES_HZ,
    UNSUPPORTED,
    in_older_names,
    parameters_from,
)
from app.core.errors import InputError, Problem
from app.core.records.trajectory import Samples
from app.logs.base import Table, contents, numbers, rows_of
from app.logs.dataflash import parameters_in, read_tables

_WANTED: Final = frozenset({"PSCD", "PIDA", "CTUN", "GUIP", "MODE", "PARM"})
_MOTION: Final = ("PD", "DPD", "VD", "DVD", "DAD", "TVD")
_TERMS: Final = ("P", "I", "D", "FF", "DFF")
_NOT_POSITION: Final = ("Terrain", "vX", "vY", "vZ", "aX", "aY", "aZ")
_GUIDED: Final = 4
_LIMITED: Final = 1
_WAYPOINT_NAVIGATION: Final = 1 << 6
_SAME_LOOP_S: Final = 0.0012


def read_ardupilot_log(stream: BinaryIO, *, name: str) -> LoopLog:
    """Read the rows in flight of the longest time in GUIDED.

    Raises InputError if there are none, or naming the message or parameter that is missing or not supported.
    """
    tables = read_tables(contents(stream), _WANTED)
    loop = tables.get("PSCD", {})
    if not {"TimeUS", *_MOTION} <= loop.keys():
        raise _refused(name, "PSCD", "is missing: the log does not contain the vertical loop")
    time_s = numbers(loop["TimeUS"]) / 1e6
    up = {each: -numbers(loop[each]) for each in _MOTION}
    started_anew = (up["DPD"] == up["PD"]) & (up["DVD"] == up["VD"])
    known = np.isfinite(np.sum(list(up.values()), axis=0))
    rows, begin_s, end_s = _longest_in_guided(tables, time_s, np.flatnonzero(known & ~started_anew))
    if not rows.size:
        raise _refused(name, "PSCD", "has no row in flight in GUIDED, the mode that the replica computes")
    time_s = time_s[rows]
    values = _values(tables, float(time_s[0]))
    if "PSC_POSZ_P" not in values:
        raise _refused(name, "PSC_POSZ_P", "is missing, and PSC_D_POS_P of release 4.7 too")
    rate_hz = values.get(LOOP_RATE, LOOP_RATE_HZ)
    control, tuning = (_beside(tables.get(each, {}), time_s) for each in ("PIDA", "CTUN"))
    return LoopLog(
        parameters=parameters_from(values),
        rate_hz=rate_hz if LOOP_RATES_HZ[0] <= rate_hz <= LOOP_RATES_HZ[1] else LOOP_RATE_HZ,
        time_s=time_s,
        z_m=up["PD"][rows],
        z_d_m=up["DPD"][rows],
        v_d_m_s=up["DVD"][rows],
        a_d_m_s2=up["DAD"][rows],
        v_t_m_s=up["TVD"][rows],
        hover=tuning("ThH"),
        control_per_mille=np.sum([control(term) for term in _TERMS], axis=0),
        throttle=tuning("ThI"),
        limited=(np.nan_to_num(control("Flags")).astype(np.int64) & _LIMITED) > 0,
        targets=tuple(target for target in _targets(tables, values) if begin_s <= target[0] < end_s),
    )


def _longest_in_guided(
    tables: Mapping[str, Table], time_s: Samples, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], float, float]:
    """Those of `rows` in the time in GUIDED that has most of them, and its begin and end, s."""
    changes = list(rows_of(tables.get("MODE", {}), "TimeUS", "ModeNum"))
    begins = [next(same) for _, same in groupby(changes, key=lambda change: change[1])]
    ends_s = [*(begin_s for begin_s, _ in begins), np.inf][1:]
    found = [(rows[:0], 0.0, 0.0)]
    for (begin_s, mode), end_s in zip(begins, ends_s, strict=True):
        if mode == _GUIDED:
            within = rows[(time_s[rows] >= begin_s) & (time_s[rows] < end_s)]
            found.append((within[np.diff(time_s[within], prepend=-np.inf) > 0.0], begin_s, end_s))
    return max(found, key=lambda each: len(each[0]))


def _values(tables: Mapping[str, Table], until_s: float) -> dict[str, float]:
    """Parameters by name as they were when the flight began."""
    wanted = {*FIRMWARE_NAMES, *UNSUPPORTED, LOOP_RATE, "GUID_OPTIONS"}
    logged = dict(in_older_names(each, value) for at_s, each, value in parameters_in(tables) if at_s <= until_s)
    return {each: value for each, value in logged.items() if each in wanted}


def _targets(tables: Mapping[str, Table], values: Mapping[str, float]) -> list[tuple[float, float]]:
    """Time and altitude of the position targets; none if others were sent too, or the vehicle plans its way to them."""
    table = tables.get("GUIP", {})
    other = any(np.any(numbers(table[each])) for each in _NOT_POSITION if each in table)
    planned = int(np.nan_to_num(values.get("GUID_OPTIONS", 0.0))) & _WAYPOINT_NAVIGATION
    return [] if other or planned else [(at_s, z_m) for at_s, z_m in rows_of(table, "TimeUS", "pZ")]


def _beside(table: Table, time_s: Samples) -> Callable[[str], Samples]:
    """A function that gives a column of `table` at the rows of `time_s`; NaN where it has no row of the same loop."""
    at_s = numbers(table["TimeUS"]) / 1e6 if "TimeUS" in table else np.empty(0)

    def column(name: str) -> Samples:
        if name not in table or not at_s.size:
            return np.full(len(time_s), np.nan)
        after = np.clip(np.searchsorted(at_s, time_s), 0, len(at_s) - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(np.abs(at_s[after] - time_s) <= np.abs(at_s[before] - time_s), after, before)
        same_loop = np.abs(at_s[nearest] - time_s) <= _SAME_LOOP_S
        return np.where(same_loop, numbers(table[name])[nearest], np.nan)

    return column


def _refused(name: str, field: str, reason: str) -> InputError:
    return InputError(
        f"{name} cannot be compared with the replica.",
        hint="Give ArduCopter's .bin log of a flight in GUIDED, recorded with NTUN, CTUN and PID in LOG_BITMASK.",
        problems=(Problem(field, reason),),
    )
