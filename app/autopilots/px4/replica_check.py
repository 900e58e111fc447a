"""PX4's loop beside its replica: its on-board log, and traces of the loop alone or of a flight: described CSV, one row
per estimate of position (`trace_table`)."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.log import SOURCES, TARGET
from app.autopilots.px4.replica.parameters import DEFAULTS, STEP_S, UNSUPPORTED, Parameters, parameters_from
from app.autopilots.px4.replica.replay import LoopLog, LoopTrace, TraceReplay, replayed, replica_of
from app.autopilots.px4.replica.vertical import FLIGHT, HOVER_MAX, HOVER_MIN, INPUTS, OUTPUTS, RAMP_UP
from app.autopilots.recording import Recording, refusal
from app.autopilots.replica_check import (
    Kind,
    LoopReplica,
    Replay,
    ReplicaCheck,
    Signal,
    SignalResult,
    check_replay,
    grouped,
    replay_of_log,
)
from app.core.errors import InputError, Problem
from app.core.records.trajectory import Samples
from app.logs.trace_table import TraceChecks, TraceTable, has_columns, read_trace_table

_TOLERANCE: Final = 1e-5
_PRECISION: Final = "firmware and replica compute in single precision"

_SIGNALS: Final[Mapping[str, Signal]] = MappingProxyType(
    {
        "takeoff_state": Signal("State of the takeoff", "", 0, _TOLERANCE, _PRECISION),
        "out_vz_m_s": Signal("Velocity target", "m/s", 3, _TOLERANCE, _PRECISION),
        "out_az_m_s2": Signal("Acceleration target", "m/s²", 3, _TOLERANCE, _PRECISION),
        "out_thrust": Signal("Thrust", "of full", 4, _TOLERANCE, _PRECISION),
        "ramp_m_s": Signal("Limit of the climb rate", "m/s", 3, _TOLERANCE, _PRECISION),
        "out_vz_derivative": Signal("Derivative of the velocity", "m/s²", 3, _TOLERANCE, _PRECISION),
    }
)
_MEDIANS: Final[Mapping[str, float]] = MappingProxyType(
    {"takeoff_state": _TOLERANCE, "out_vz_m_s": 1e-6, "out_az_m_s2": 2e-3, "out_thrust": 1e-4}
)
"""What the median difference of a signal over a flight may be."""
_LOG_MEDIANS: Final[Mapping[str, float]] = MappingProxyType(
    {"out_vz_m_s": 1e-6, "out_az_m_s2": 5e-4, "out_thrust": 1e-3}
)
"""The same in a log, whose rows are computed from themselves or the row before, with a hover thrust interpolated."""

_DOWN: Final = "Altitude, velocity and acceleration are positive down, as in PX4."
_HOW: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "out_thrust": ("the acceleration target of the same row", "no hover thrust was logged beside it"),
        "out_vz_m_s": ("the position and the set-point of the same row", "no set-point was logged beside it"),
        "out_az_m_s2": ("the row before", "the set-points changed, or not every position was logged"),
    }
)
_NEEDED: Final = (
    "altitude_m", "climb_rate_m_s", "reference_m", "climb_rate_target_m_s", "acceleration_target_m_s2", "thrust_target",
    "takeoff_state",
)  # fmt: skip
_SAME_RUN_S: Final = 0.004
"""A target is published at most so long after the position that it was computed from, the next position later."""

_DERIVATIVE: Final = "z_derivative_m_s"
_NEW: Final = "set_new"
_MODE: Final = "offboard"
_SETPOINTS: Final = ("set_z_m", "set_vz_m_s", "set_az_m_s2")
_ALWAYS: Final = ("takeoff_state", "out_vz_m_s", "out_az_m_s2", "out_thrust")
_MESSAGES: Final = ("armed", "landed", "ground_contact")
_MAY_BE_EMPTY: Final = (
    *_SETPOINTS, "hover_estimate", "out_vz_m_s", "out_az_m_s2", "out_thrust",
    "az_m_s2", "true_z_m", *OUTPUTS[len(_ALWAYS):], _DERIVATIVE,
)  # fmt: skip
COLUMNS: Final = ("time_s", *(each for each in INPUTS if each not in (_DERIVATIVE, _NEW)), *_ALWAYS)
_TRACE_HINT: Final = (
    "A trace of PX4's loop has # and a JSON object with parameters, a header, and one row per estimate of position "
    f"with the columns {','.join(COLUMNS)}."
)


def _check_log(recording: Recording, name: str, _given: str) -> ReplicaCheck:
    log = px4_loop_log(recording, name=name)
    time_s = log.time_s[log.place]
    replay = replay_of_log(log, replica_of(log), time_s, gains=log.parameters.gains, notes=_log_notes)
    if not replay.recorded:
        raise InputError(
            f"{name} cannot be compared with the replica.",
            hint="Give a .ulg log with hover_thrust_estimate and trajectory_setpoint (bit 0 of SDLOG_PROFILE).",
            problems=(Problem("file", "has no set-point and no hover thrust beside any row in flight"),),
        )
    return _judged_by_medians(replay, _LOG_MEDIANS, kind="log")


def _check_trace(stream: BinaryIO, name: str) -> ReplicaCheck:
    trace = read_px4_trace(stream, name=name)
    computed = replayed(trace)
    replay = Replay(
        time_s=trace.time_s,
        recorded=dict(zip(OUTPUTS, trace.outputs.T, strict=True)),
        replica=dict(zip(OUTPUTS, computed.outputs.T, strict=True)),
        gains=trace.parameters.gains,
        notes=(*_order_notes(computed), _DOWN),
    ).compared
    if trace.flown:
        return _judged_by_medians(replay, _MEDIANS, kind="trace")
    return check_replay(_SIGNALS, replay, kind="trace")


def read_px4_trace(stream: BinaryIO, *, name: str) -> LoopTrace:
    """Read a run, plain or gzipped. Where they were not recorded, the derivative of z is the difference of z, and
    set-points count as new in a row where they change, under offboard control and outside of a flight in every row.

    Raises InputError naming the line and the column or key of the first error.
    """
    table = read_trace_table(stream, name=name, columns=COLUMNS, may_be_empty=_MAY_BE_EMPTY)
    checks, described = TraceChecks(name, _TRACE_HINT), table.description
    checks.require_flags(table, (*_MESSAGES, "want_takeoff"))
    checks.require_positive(table, "dt_s")
    derived = {_DERIVATIVE: np.diff(table["z_m"], prepend=table["z_m"][0]) / table["dt_s"], _NEW: _new(table)}
    unknown = np.full(len(table), np.nan)
    known = derived | dict(table.columns)
    inputs = np.ascontiguousarray(np.column_stack([known[each] for each in INPUTS]))
    return LoopTrace(
        parameters=parameters_from(checks.numbers_in(described, "parameters")),
        filter_sample_s=checks.positive_in({"filter_sample_s": STEP_S} | dict(described), "filter_sample_s"),
        flown=_MODE in known,
        time_s=table["time_s"],
        inputs=inputs,
        late_inputs=_late(table, inputs),
        outputs=np.ascontiguousarray(np.column_stack([table.columns.get(each, unknown) for each in OUTPUTS])),
    )


def _new(table: TraceTable) -> Samples:
    """1 in rows with set-points that arrived since the row before, shape (n,)."""
    given = np.column_stack([table[each] for each in _SETPOINTS])
    changed = np.append(True, ~_equal(given[1:], given[:-1]).all(axis=1))
    return np.where(table[_MODE] > 0.0, 1.0, changed) if _MODE in table.columns else np.ones(len(table))


def _late(table: TraceTable, inputs: Samples) -> Samples:
    """Inputs if each message with the time stamp of a flight's row was read in the next row, shape (n, 15). Set-points
    of auto modes are computed from the estimate of the row, before the loop runs, so that they are never late."""
    if _MODE not in table.columns:
        return inputs
    may_be_late = np.isin(INPUTS, _MESSAGES) | (np.isin(INPUTS, (*_SETPOINTS, _NEW)) & (table[_MODE] > 0.0)[:, None])
    return np.where(may_be_late, np.concatenate([inputs[:1], inputs[:-1]]), inputs)


def _order_notes(replay: TraceReplay) -> Iterable[str]:
    if replay.late_rows:
        rows = ", ".join(map(str, replay.late_rows))
        yield f"The recording fits if the set-point or flag that changed in these rows was read one row later: {rows}."
    if replay.armed_before:
        yield "The recording fits if the spool-up began one row before it."


def _log_notes(rows: Mapping[str, int]) -> Iterable[str]:
    for name, (how, missing) in _HOW.items():
        title = f"The {_SIGNALS[name].title.lower()}"
        if rows[name]:
            yield f"{title} was computed from {how}, in {grouped(rows[name])} rows."
        else:
            yield f"{title} was not computed: {missing}."
    yield _DOWN


def _judged_by_medians(replay: Replay, medians: Mapping[str, float], *, kind: Kind) -> ReplicaCheck:
    """The result of a flight; rows beyond what a median may be are marked, and decide nothing."""
    limited = {name: replace(each, tolerance=medians.get(name, each.tolerance)) for name, each in _SIGNALS.items()}
    result = check_replay(limited, replay, kind=kind)
    signals = tuple(_judged(signal, replay) for signal in result.signals if signal.name in medians)
    differing = [signal.name for signal in signals if signal.verdict == "differs"]
    total = grouped(result.rows)
    sentence = (
        f"The replica differs: over {total} rows the median of {', '.join(differing)} is beyond its tolerance."
        if differing
        else f"The replica agrees: over {total} rows the medians of all {len(signals)} signals are within the "
        "tolerances."
    )
    return replace(
        result,
        passed=not differing,
        sentence=sentence,
        signals=signals,
        first_different_row=result.first_different_row if differing else None,
    )


def _judged(signal: SignalResult, replay: Replay) -> SignalResult:
    """The signal judged by its median difference over the rows with a value; where only one side has one, they are
    infinitely apart in the median, and left out of the largest difference."""
    recorded, computed = replay.recorded[signal.name], replay.replica[signal.name]
    apart = np.abs(np.asarray(recorded - computed, dtype=np.float64))
    largest = float(np.nanmax(apart, initial=0.0))
    given = np.isfinite(recorded) | np.isfinite(computed)
    median = float(np.median(np.where(np.isnan(apart), np.inf, apart)[given]))
    verdict = signal.verdict if signal.verdict == "exact" else "agrees" if median <= signal.tolerance else "differs"
    return replace(
        signal,
        largest_difference=largest,
        median_difference=median,
        allowance="the median over the flight; at a limit the thrust depends on the tilt, which is not recorded",
        verdict=verdict,
    )


def px4_loop_log(recording: Recording, *, name: str) -> LoopLog:
    """All runs of the loop from the ramp of a takeoff on, until a parameter of the loop changes.

    Raises InputError that names the topic or parameter that is missing or not supported.
    """
    refused = refusal(
        f"{name} cannot be compared with the replica.",
        "Give PX4's .ulg log of a flight with position control, recorded with bits 0 and 1 of SDLOG_PROFILE: with "
        "bit 1 (estimator replay) every position is logged.",
        error=InputError,
    )
    columns = recording.columns
    for each in _NEEDED:
        if each not in columns:
            source = SOURCES[each]
            raise refused(str(source) if source.message in recording.sources else source.message, "is missing")
    position_s, time_s = columns["altitude_m"].time_s, columns["thrust_target"].time_s
    takeoff = recording.at("takeoff_state", time_s)
    place = np.searchsorted(position_s, time_s, side="right") - 1
    fresh = (place >= 0) & (time_s - position_s[place] <= _SAME_RUN_S)
    thrust = columns["thrust_target"].values
    rows = np.flatnonzero(fresh & (takeoff >= RAMP_UP) & np.isfinite(thrust))
    rows = rows[np.diff(place[rows], prepend=-1) > 0]
    if not rows.size:
        raise refused(TARGET, "has no row in flight beside a position")
    begin_s = float(time_s[rows[0]])
    history = recording.history({*DEFAULTS, *UNSUPPORTED})
    changes_s = [change_s for change_s in history.times_s if change_s > begin_s]
    rows = rows[time_s[rows] < min(changes_s, default=np.inf)]
    values = history.at(begin_s)
    for gain in Parameters().gains:
        if gain not in values:
            raise refused(gain, "is missing")
    parameters = parameters_from(values)
    set_z_m = -columns["reference_m"].values
    set_vz_m_s, set_az_m_s2, known = _set_points(recording, time_s, set_z_m)
    up, down = (recording.at(f"{each}_limit_m_s", time_s) for each in ("climb", "descent"))
    derivative = "altitude_derivative_m_s" if "altitude_derivative_m_s" in columns else "climb_rate_m_s"
    return LoopLog(
        parameters=parameters,
        time_s=position_s,
        z_m=-columns["altitude_m"].values,
        vz_m_s=-columns["climb_rate_m_s"].values,
        z_derivative_m_s=-columns[derivative].values,
        place=place[rows],
        flying=((takeoff == FLIGHT) & ~(recording.at("has_contact", time_s) > 0.0))[rows],
        set_z_m=set_z_m[rows],
        set_vz_m_s=set_vz_m_s[rows],
        set_az_m_s2=set_az_m_s2[rows],
        known=known[rows],
        limit_up_m_s=np.where(np.isfinite(up), up, parameters.climb_m_s)[rows],
        limit_down_m_s=np.where(np.isfinite(down), down, parameters.descent_m_s)[rows],
        hover=_hover(recording, time_s, takeoff, parameters)[rows],
        out_vz_m_s=-columns["climb_rate_target_m_s"].values[rows],
        out_az_m_s2=-columns["acceleration_target_m_s2"].values[rows],
        out_thrust=thrust[rows],
    )


def _set_points(recording: Recording, time_s: Samples, set_z_m: Samples) -> tuple[Samples, Samples, NDArray[np.bool_]]:
    """Set-points of velocity and acceleration in force at each time, shape (n,) each, and whether they are known.

    They are if the last message has the altitude in force, and is of the same time or followed by an equal one: most
    are not logged.
    """
    names = ("given_altitude_m", "given_climb_rate_m_s", "given_acceleration_m_s2")
    if not recording.columns.keys() >= set(names):
        unknown = np.full(len(time_s), np.nan)
        return unknown, unknown, np.zeros(len(time_s), dtype=np.bool_)
    at_s = recording.columns[names[0]].time_s
    z, vz, az = (-recording.columns[name].values for name in names)
    last = np.maximum(np.searchsorted(at_s, time_s, side="right") - 1, 0)
    following = np.minimum(last + 1, len(at_s) - 1)
    repeated = (following > last) & _equal(vz[following], vz[last]) & _equal(az[following], az[last])
    known = _equal(z[last], set_z_m) & (at_s[last] <= time_s) & ((at_s[last] == time_s) | repeated)
    return vz[last], az[last], known


def _equal(one: Samples, other: Samples) -> NDArray[np.bool_]:
    return np.asarray((one == other) | (np.isnan(one) & np.isnan(other)))


def _hover(recording: Recording, time_s: Samples, takeoff: Samples, parameters: Parameters) -> Samples:
    """Hover thrust in force at each time, shape (n,); NaN where it is not known.

    In flight it is between two valid estimates that were logged around it, or before the first valid one the parameter.
    """
    on_ground = np.where(takeoff < FLIGHT, parameters.hover_thrust, np.nan)
    if not recording.columns.keys() >= {"hover_thrust", "hover_thrust_is_valid"}:
        return on_ground
    at_s, valid = recording.columns["hover_thrust"].time_s, recording.columns["hover_thrust_is_valid"].values > 0.0
    estimates = np.clip(recording.columns["hover_thrust"].values, HOVER_MIN, HOVER_MAX)
    last = np.searchsorted(at_s, time_s, side="right") - 1
    following = np.minimum(last + 1, len(at_s) - 1)
    around = (last >= 0) & (following > last) & valid[last] & valid[following]
    none_yet = ~np.logical_or.accumulate(valid)[following]
    in_flight = np.where(none_yet, parameters.hover_thrust, np.nan)
    in_flight[around] = np.interp(time_s[around], at_s, estimates)
    return np.where(takeoff < FLIGHT, on_ground, in_flight)


REPLICA: Final = LoopReplica(
    signals=_SIGNALS,
    figures=(
        ("Takeoff and velocity target", ("takeoff_state", "ramp_m_s", "out_vz_m_s")),
        ("Controller and thrust", ("out_vz_derivative", "out_az_m_s2", "out_thrust")),
    ),
    note=_DOWN,
    check_log=_check_log,
    is_trace=partial(has_columns, columns=COLUMNS),
    check_trace=_check_trace,
)
