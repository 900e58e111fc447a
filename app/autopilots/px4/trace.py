"""Reader of recorded runs of PX4's vertical loop: described CSV, one row per estimate of position (`trace_table`)."""

from typing import BinaryIO, Final

import numpy as np

from app.autopilots.px4.replica.parameters import STEP_S, parameters_from
from app.autopilots.px4.replica.replay import LoopTrace
from app.autopilots.px4.replica.vertical import INPUTS, OUTPUTS
from app.core.records.trajectory import Samples
from app.logs.trace_table import TraceChecks, TraceTable, read_trace_table

_DERIVATIVE: Final = "z_derivative_m_s"
_NEW: Final = "set_new"
_MODE: Final = "offboard"
_SETPOINTS: Final = ("set_z_m", "set_vz_m_s", "set_az_m_s2")
_ALWAYS: Final = ("takeoff_state", "out_vz_m_s", "out_az_m_s2", "out_thrust")
_GIVEN: Final = tuple(each for each in INPUTS if each not in (_DERIVATIVE, _NEW))
_MESSAGES: Final = ("armed", "landed", "ground_contact")
_FLAGS: Final = (*_MESSAGES, "want_takeoff")
_MAY_BE_EMPTY: Final = (
    *_SETPOINTS, "hover_estimate", "out_vz_m_s", "out_az_m_s2", "out_thrust",
    "az_m_s2", "true_z_m", *OUTPUTS[len(_ALWAYS):], _DERIVATIVE,
)  # fmt: skip
COLUMNS: Final = ("time_s", *_GIVEN, *_ALWAYS)
_HINT: Final = (
    "A trace of PX4's loop has # and a JSON object with parameters, a header, and one row per estimate of position "
    f"with the columns {','.join(COLUMNS)}."
)


def read_px4_trace(stream: BinaryIO, *, name: str) -> LoopTrace:
    """Read a run, plain or gzipped. Where they were not recorded, the derivative of z is the difference of z, and
    set-points count as new in a row where they change, under offboard control and outside of a flight in every row.

    Raises InputError naming the line and the column or key of the first error.
    """
    table = read_trace_table(stream, name=name, columns=COLUMNS, may_be_empty=_MAY_BE_EMPTY)
    checks, described = TraceChecks(name, _HINT), table.description
    checks.require_flags(table, _FLAGS)
    checks.require_positive(table, "dt_s")
    derived = {_DERIVATIVE: np.diff(table["z_m"], prepend=table["z_m"][0]) / table["dt_s"], _NEW: _new(table)}
    known = derived | dict(table.columns)
    inputs = np.ascontiguousarray(np.column_stack([known[each] for each in INPUTS]))
    return LoopTrace(
        parameters=parameters_from(checks.numbers_in(described, "parameters")),
        filter_sample_s=checks.positive_in({"filter_sample_s": STEP_S} | dict(described), "filter_sample_s"),
        flown=_MODE in known,
        time_s=table["time_s"],
        inputs=inputs,
        late_inputs=_late(table, inputs),
        outputs=_outputs(table),
    )


def _new(table: TraceTable) -> Samples:
    """1 in rows with set-points that arrived since the row before, shape (n,)."""
    given = np.column_stack([table[each] for each in _SETPOINTS])
    same = (given[1:] == given[:-1]) | (np.isnan(given[1:]) & np.isnan(given[:-1]))
    changed = np.append(True, ~same.all(axis=1))
    return np.where(table[_MODE] > 0.0, 1.0, changed) if _MODE in table.columns else np.ones(len(table))


def _late(table: TraceTable, inputs: Samples) -> Samples:
    """Inputs if each message with the time stamp of a flight's row was read in the next row, shape (n, 15). Set-points
    of auto modes are computed from the estimate of the row, before the loop runs, so that they are never late."""
    if _MODE not in table.columns:
        return inputs
    may_be_late = np.isin(INPUTS, _MESSAGES) | (np.isin(INPUTS, (*_SETPOINTS, _NEW)) & (table[_MODE] > 0.0)[:, None])
    return np.where(may_be_late, np.concatenate([inputs[:1], inputs[:-1]]), inputs)


def _outputs(table: TraceTable) -> Samples:
    unknown = np.full(len(table), np.nan)
    return np.ascontiguousarray(np.column_stack([table.columns.get(each, unknown) for each in OUTPUTS]))
