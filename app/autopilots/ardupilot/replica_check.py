"""ArduCopter's loop beside its replica: its on-board log, and traces: described CSV, one row per step
(`trace_table`)."""

from collections.abc import Iterable, Mapping
from functools import partial
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.ardupilot.log import NOT_POSITION, TERMS, history
from app.autopilots.ardupilot.replica.parameters import (
    DEFAULTS,
    LOOP_RATE,
    LOOP_RATE_HZ,
    LOOP_RATES_HZ,
    UNSUPPORTED,
    parameters_from,
)
from app.autopilots.ardupilot.replica.replay import Hover, LoopLog, LoopTrace, replayed, replica_of
from app.autopilots.ardupilot.replica.vertical import INPUTS, OUTPUTS
from app.autopilots.recording import Column, Recording, Span, refusal, spans_of
from app.autopilots.replica_check import (
    LoopReplica,
    Replay,
    ReplicaCheck,
    Signal,
    check_replay,
    grouped,
    replay_of_log,
)
from app.core.errors import InputError
from app.core.records.trajectory import Samples
from app.logs.trace_table import TraceChecks, TraceTable, has_columns, read_trace_table

_PRECISION: Final = "firmware and recording have single precision"


_SIGNALS: Final[Mapping[str, Signal]] = MappingProxyType(
    {
        "z_d_m": Signal("Desired altitude", "m", 3, 1e-4, _PRECISION),
        "v_d_m_s": Signal("Desired climb rate", "m/s", 3, 1e-4, _PRECISION),
        "a_d_m_s2": Signal("Desired acceleration", "m/s²", 3, 3e-4, _PRECISION),
        "v_t_m_s": Signal("Climb rate target", "m/s", 3, 1e-4, _PRECISION),
        "a_t_m_s2": Signal("Acceleration target", "m/s²", 3, 5e-4, _PRECISION),
        "i_term_permille": Signal("Integrator of the acceleration controller", "‰ of throttle", 1, 0.14, _PRECISION),
        "throttle": Signal("Demanded throttle", "of full", 4, 5e-4, _PRECISION),
        "throttle_filtered": Signal("Filtered throttle", "of full", 4, 5e-4, _PRECISION),
    }
)
_UP: Final = "Altitude, climb rate and acceleration are positive up."
_MOTION: Final = (
    "altitude_m", "desired_altitude_m", "climb_rate_m_s", "desired_climb_rate_m_s", "desired_acceleration_m_s2",
    "climb_rate_target_m_s",
)  # fmt: skip
_GUIDED: Final = 4
_LIMITED: Final = 1
_OPTIONS: Final = "GUID_OPTIONS"
_WAYPOINT_NAVIGATION: Final = 1 << 6
_SAME_LOOP_S: Final = 0.0012

COLUMNS: Final = ("t_s", *INPUTS, *OUTPUTS)
_TRACE_HINT: Final = (
    "A trace of ArduCopter's loop has # and a JSON object with params, dt_s, start and init, a header, and one row per "
    f"step with the columns {','.join(COLUMNS)}."
)
_IN_SI: Final = {"WPNAV_SPEED_UP_m_s", "WPNAV_SPEED_DN_m_s", "WPNAV_ACCEL_Z_m_s2"}


def _check_log(recording: Recording, name: str, _given: str) -> ReplicaCheck:
    log = ardupilot_loop_log(recording, name=name)
    replay = replay_of_log(log, replica_of(log), log.time_s, gains=log.parameters.gains, notes=_notes)
    return check_replay(_SIGNALS, replay, kind="log")


def _check_trace(stream: BinaryIO, name: str) -> ReplicaCheck:
    trace = read_ardupilot_trace(stream, name=name)
    followed = int(trace.followed.sum())
    limited = f"{grouped(followed)} rows at a throttle limit are each computed from the recorded row before."
    replay = Replay(
        time_s=trace.time_s,
        recorded=dict(zip(OUTPUTS, trace.outputs.T, strict=True)),
        replica=dict(zip(OUTPUTS, replayed(trace).T, strict=True)),
        gains=trace.parameters.gains,
        notes=(limited, _UP) if followed else (_UP,),
    )
    return check_replay(_SIGNALS, replay, kind="trace")


def read_ardupilot_trace(stream: BinaryIO, *, name: str) -> LoopTrace:
    """Read a run, plain or gzipped. Raises InputError naming the line and the column or key of the first error."""
    table = read_trace_table(stream, name=name, columns=COLUMNS)
    checks, described = TraceChecks(name, _TRACE_HINT), table.description
    checks.require_flags(table, ("limit_lower", "limit_upper"))
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
        values[each.partition("_m_")[0]] = values.pop(each) * 100.0
    slew = {each: described[each] for each in ("TKOFF_SLEW_TIME", "TKOFF_THR_MAX") if described.get(each) is not None}
    return values | {each: checks.number_in(slew, each) for each in slew}


def _start(checks: TraceChecks, described: Mapping[str, object]) -> Hover | None:
    start = str(described.get("start"))
    if start.startswith("ramp"):
        return None
    if start != "hover":
        raise checks.malformed("line 1, start", f"must be hover or ramp, got {start[:40]!r}")
    first = checks.object_in(described, "init")
    z_m, v_m_s, a_m_s2, throttle = (checks.number_in(first, each) for each in ("z_m", "v_m_s", "a_m_s2", "throttle"))
    return Hover(throttle, z_m, v_m_s, a_m_s2)


def _notes(rows: Mapping[str, int]) -> Iterable[str]:
    yield "Climb rate target and demanded throttle were computed from the same row of the log."
    if rows["z_d_m"]:
        yield f"The desired motion was shaped again from the row before, in {grouped(rows['z_d_m'])} rows."
    else:
        yield "The desired motion was not shaped again: the log has no position targets (GUIP), or not only those."
    if not rows["throttle"]:
        yield "The demanded throttle was not computed: the log has no PIDA and CTUN beside PSCD."
    yield _UP


def ardupilot_loop_log(recording: Recording, *, name: str) -> LoopLog:
    """The rows in flight of the longest time in GUIDED.

    Raises InputError if there are none, or naming the message or parameter that is missing or not supported.
    """
    refused = refusal(
        f"{name} cannot be compared with the replica.",
        "Give ArduCopter's .bin log of a flight in GUIDED, recorded with NTUN, CTUN and PID in LOG_BITMASK.",
        error=InputError,
    )
    columns = recording.columns
    if not columns.keys() >= set(_MOTION) or columns["altitude_m"].source != "PSCD.PD":
        raise refused("PSCD", "is missing: the log does not contain the vertical loop")
    z, z_d, v, v_d, a_d, v_t = (columns[each].values for each in _MOTION)
    known = np.isfinite(np.sum((z, z_d, v, v_d, a_d, v_t), axis=0))
    started_anew = (z_d == z) & (v_d == v)
    rows, guided = _longest_in_guided(recording, np.flatnonzero(known & ~started_anew))
    if not rows.size:
        raise refused("PSCD", "has no row in flight in GUIDED, the mode that the replica computes")
    time_s = columns["altitude_m"].time_s[rows]
    values = history(recording, frozenset({*DEFAULTS, *UNSUPPORTED, LOOP_RATE, _OPTIONS})).at(float(time_s[0]))
    if "PSC_POSZ_P" not in values:
        raise refused("PSC_POSZ_P", "is missing, and PSC_D_POS_P of release 4.7 too")
    rate_hz = values.get(LOOP_RATE, LOOP_RATE_HZ)

    def logged(name: str) -> Samples:
        return _of_same_loop(columns.get(name), time_s)

    return LoopLog(
        parameters=parameters_from(values),
        rate_hz=rate_hz if LOOP_RATES_HZ[0] <= rate_hz <= LOOP_RATES_HZ[1] else LOOP_RATE_HZ,
        time_s=time_s,
        z_m=z[rows],
        z_d_m=z_d[rows],
        v_d_m_s=v_d[rows],
        a_d_m_s2=a_d[rows],
        v_t_m_s=v_t[rows],
        hover=logged("hover_throttle"),
        control_per_mille=np.sum([logged(f"control_{term}") for term in TERMS], axis=0),
        throttle=logged("demanded_throttle"),
        limited=(np.nan_to_num(logged("control_Flags")).astype(np.int64) & _LIMITED) > 0,
        targets=tuple(target for target in _targets(columns, values) if guided.begin_s <= target[0] < guided.end_s),
    )


def _longest_in_guided(recording: Recording, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], Span]:
    """Those of `rows` in the time in GUIDED that has most of them, and this time."""
    time_s, mode = recording.columns["altitude_m"].time_s[rows], recording.columns.get("mode")
    modes = [] if mode is None else zip(mode.time_s.tolist(), (mode.values == _GUIDED).tolist(), strict=True)
    spans = [Span(0.0, 0.0), *spans_of(modes)]
    found = [(rows[(time_s >= each.begin_s) & (time_s < each.end_s)], each) for each in spans]
    return max(found, key=lambda each: len(each[0]))


def _targets(columns: Mapping[str, Column], values: Mapping[str, float]) -> list[tuple[float, float]]:
    """Time and altitude of the position targets; none if others were sent too, or the vehicle plans its way to them."""
    other = any(np.any(columns[f"target_{each}"].values) for each in NOT_POSITION if f"target_{each}" in columns)
    planned = int(np.nan_to_num(values.get(_OPTIONS, 0.0))) & _WAYPOINT_NAVIGATION
    target = columns.get("target_altitude_m")
    if other or planned or target is None:
        return []
    return list(zip(target.time_s.tolist(), target.values.tolist(), strict=True))


def _of_same_loop(column: Column | None, time_s: Samples) -> Samples:
    """A column at the rows of `time_s`, shape (n,); NaN where it has no row of the same loop."""
    if column is None:
        return np.full(len(time_s), np.nan)
    at_s = column.time_s
    after = np.clip(np.searchsorted(at_s, time_s), 0, len(at_s) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(at_s[after] - time_s) <= np.abs(at_s[before] - time_s), after, before)
    return np.where(np.abs(at_s[nearest] - time_s) <= _SAME_LOOP_S, column.values[nearest], np.nan)


REPLICA: Final = LoopReplica(
    signals=_SIGNALS,
    figures=(("Shaped target", OUTPUTS[:3]), ("Controllers and throttle", OUTPUTS[3:])),
    note=_UP,
    check_log=_check_log,
    is_trace=partial(has_columns, columns=COLUMNS),
    check_trace=_check_trace,
)
