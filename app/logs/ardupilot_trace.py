"""Reader of recorded runs of ArduCopter's vertical loop: described CSV, one row per step (`trace_table`)."""

from collections.abc import Mapping
from typing import BinaryIO, Final

import numpy as np

from app.core.control.ardupilot import INPUTS, OUTPUTS
from app.core.control.ardupilot_parameters import parameters_from
from app.core.control.ardupilot_replay import Hover, LoopTrace
from app.core.errors import InputError, Problem
from app.logs.trace_table import TraceTable, has_columns, read_trace_table

COLUMNS: Final = ("t_s", *INPUTS, *OUTPUTS)
_FLAGS: Final = ("limit_lower", "limit_upper")
_IN_SI: Final = {"WPNAV_SPEED_UP_m_s", "WPNAV_SPEED_DN_m_s", "WPNAV_ACCEL_Z_m_s2"}
_CM: Final = 100.0
_START: Final = ("z_m", "v_m_s", "a_m_s2", "throttle")


def is_ardupilot_trace(beginning: bytes) -> bool:
    """Whether text with this beginning is such a run."""
    return has_columns(beginning, COLUMNS)


def read_ardupilot_trace(stream: BinaryIO, *, name: str) -> LoopTrace:
    """Read a run, plain or gzipped. Raises InputError naming the line and the column or key of the first error."""
    table = read_trace_table(stream, name=name, columns=COLUMNS)
    for flag in _FLAGS:
        if not np.isin(table[flag], (0.0, 1.0)).all():
            line = int(np.flatnonzero(~np.isin(table[flag], (0.0, 1.0)))[0]) + 3
            raise _malformed(name, f"line {line}, {flag}", "must be 0 or 1")
    described = table.description
    dt_s = _number(name, described, "dt_s")
    if dt_s <= 0.0:
        raise _malformed(name, "line 1, dt_s", "must be positive")
    return LoopTrace(
        parameters=parameters_from(_values(name, described)),
        dt_s=dt_s,
        hover=_start(name, described),
        time_s=table["t_s"],
        inputs=_columns(table, INPUTS),
        outputs=_columns(table, OUTPUTS),
    )


def _columns(table: TraceTable, names: tuple[str, ...]) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.ascontiguousarray(np.column_stack([table[each] for each in names]))


def _values(name: str, described: Mapping[str, object]) -> dict[str, float]:
    """The firmware's parameters by name, in its units; those of WPNAV may be recorded in m instead of cm."""
    given = _object(name, described, "params")
    values = {each: _number(name, given, each) for each in given}
    for each in _IN_SI & values.keys():
        values[each.partition("_m_")[0]] = values.pop(each) * _CM
    slew = {each: described[each] for each in ("TKOFF_SLEW_TIME", "TKOFF_THR_MAX") if described.get(each) is not None}
    return values | {each: _number(name, slew, each) for each in slew}


def _start(name: str, described: Mapping[str, object]) -> Hover | None:
    start = str(described.get("start"))
    if start.startswith("ramp"):
        return None
    if start != "hover":
        raise _malformed(name, "line 1, start", f"must be hover or ramp, got {start[:40]!r}")
    first = _object(name, described, "init")
    z_m, v_m_s, a_m_s2, throttle = (_number(name, first, each) for each in _START)
    return Hover(throttle, z_m, v_m_s, a_m_s2)


def _object(name: str, described: Mapping[str, object], key: str) -> Mapping[str, object]:
    found = described.get(key)
    if not isinstance(found, dict):
        raise _malformed(name, f"line 1, {key}", "must be a JSON object")
    return found


def _number(name: str, described: Mapping[str, object], key: str) -> float:
    found = described.get(key)
    if isinstance(found, bool) or not isinstance(found, int | float) or not np.isfinite(found):
        raise _malformed(name, f"line 1, {key}", "must be a finite number")
    return float(found)


def _malformed(name: str, field: str, reason: str) -> InputError:
    return InputError(
        f"{name} cannot be replayed.",
        hint="A trace of ArduCopter's loop has # and a JSON object with params, dt_s, start and init, a header, and "
        f"one row per step with the columns {','.join(COLUMNS)}.",
        problems=(Problem(field, reason),),
    )
