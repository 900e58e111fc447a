"""Reader of recorded runs of ArduCopter's vertical loop: described CSV, one row per step (`trace_table`)."""

from collections.abc import Mapping
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.ardupilot.replica.parameters import parameters_from
from app.autopilots.ardupilot.replica.replay import Hover, LoopTrace
from app.autopilots.ardupilot.replica.vertical import INPUTS, OUTPUTS
from app.logs.trace_table import TraceChecks, TraceTable, read_trace_table

COLUMNS: Final = ("t_s", *INPUTS, *OUTPUTS)
_HINT: Final = (
    "A trace of ArduCopter's loop has # and a JSON object with params, dt_s, start and init, a header, and one row per "
    f"step with the columns {','.join(COLUMNS)}."
)
_FLAGS: Final = ("limit_lower", "limit_upper")
_IN_SI: Final = {"WPNAV_SPEED_UP_m_s", "WPNAV_SPEED_DN_m_s", "WPNAV_ACCEL_Z_m_s2"}
_CM: Final = 100.0
_START: Final = ("z_m", "v_m_s", "a_m_s2", "throttle")


def read_ardupilot_trace(stream: BinaryIO, *, name: str) -> LoopTrace:
    """Read a run, plain or gzipped. Raises InputError naming the line and the column or key of the first error."""
    table = read_trace_table(stream, name=name, columns=COLUMNS)
    checks, described = TraceChecks(name, _HINT), table.description
    checks.require_flags(table, _FLAGS)
    return LoopTrace(
        parameters=parameters_from(_values(checks, described)),
        dt_s=checks.positive_in(described, "dt_s"),
        hover=_start(checks, described),
        time_s=table["t_s"],
        inputs=_columns(table, INPUTS),
        outputs=_columns(table, OUTPUTS),
    )


def _columns(table: TraceTable, names: tuple[str, ...]) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.ascontiguousarray(np.column_stack([table[each] for each in names]))


def _values(checks: TraceChecks, described: Mapping[str, object]) -> dict[str, float]:
    """The firmware's parameters by name, in its units; those of WPNAV may be recorded in m instead of cm."""
    values = checks.numbers_in(described, "params")
    for each in _IN_SI & values.keys():
        values[each.partition("_m_")[0]] = values.pop(each) * _CM
    slew = {each: described[each] for each in ("TKOFF_SLEW_TIME", "TKOFF_THR_MAX") if described.get(each) is not None}
    return values | {each: checks.number_in(slew, each) for each in slew}


def _start(checks: TraceChecks, described: Mapping[str, object]) -> Hover | None:
    start = str(described.get("start"))
    if start.startswith("ramp"):
        return None
    if start != "hover":
        raise checks.malformed("line 1, start", f"must be hover or ramp, got {start[:40]!r}")
    first = checks.object_in(described, "init")
    z_m, v_m_s, a_m_s2, throttle = (checks.number_in(first, each) for each in _START)
    return Hover(throttle, z_m, v_m_s, a_m_s2)
