"""PX4's entry in the registry: traces with a row per estimate of position, of the loop alone or of a flight."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from app.autopilots.loop_check import (
    Kind,
    LoopCheck,
    Result,
    Signal,
    SignalResult,
    TraceReplay,
    Upload,
    grouped,
    replay_of_log,
    result_of_trace,
)
from app.autopilots.px4.log import read_px4
from app.autopilots.px4.replica.replay import LoopTrace, Replay, replayed, replica_of
from app.autopilots.px4.replica.vertical import OUTPUTS
from app.autopilots.px4.replica_check import px4_loop_log
from app.autopilots.px4.trace import is_px4_trace, read_px4_trace
from app.core.errors import InputError, Problem
from app.logs.formats import Format

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

_OF_A_FLIGHT: Final = "the median over the flight; at a limit the thrust depends on the tilt, which is not recorded"
_DOWN: Final = "Altitude, velocity and acceleration are positive down, as in PX4."
_HOW: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "out_thrust": ("the acceleration target of the same row", "no hover thrust was logged beside it"),
        "out_vz_m_s": ("the position and the set-point of the same row", "no set-point was logged beside it"),
        "out_az_m_s2": ("the row before", "the set-points changed, or not every position was logged"),
    }
)


def _examine_log(upload: Upload) -> Result:
    log = px4_loop_log(read_px4(upload.stream), name=upload.name)
    time_s = log.time_s[log.place]
    compared = replay_of_log(log, replica_of(log), time_s, gains=log.parameters.gains, notes=_log_notes)
    if not compared.recorded:
        raise InputError(
            f"{upload.name} cannot be compared with the replica.",
            hint="Give a .ulg log with hover_thrust_estimate and trajectory_setpoint (bit 0 of SDLOG_PROFILE).",
            problems=(Problem("file", "has no set-point and no hover thrust beside any row in flight"),),
        )
    return _judged_by_medians(compared, _LOG_MEDIANS, kind="log")


def _examine_trace(upload: Upload) -> Result:
    trace = read_px4_trace(upload.stream, name=upload.name)
    replay = _replayed(trace)
    return _judged_by_medians(replay, _MEDIANS, kind="trace") if trace.flown else result_of_trace(_SIGNALS, replay)


def _replayed(trace: LoopTrace) -> TraceReplay:
    replay = replayed(trace)
    return TraceReplay(
        time_s=trace.time_s,
        recorded=dict(zip(OUTPUTS, trace.outputs.T, strict=True)),
        replica=dict(zip(OUTPUTS, replay.outputs.T, strict=True)),
        gains=trace.parameters.gains,
        notes=(*_order_notes(replay), _DOWN),
    ).compared


def _order_notes(replay: Replay) -> Iterable[str]:
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


def _judged_by_medians(replay: TraceReplay, medians: Mapping[str, float], *, kind: Kind) -> Result:
    """The result of a flight; rows beyond what a median may be are marked, and decide nothing."""
    limited = {name: replace(each, tolerance=medians.get(name, each.tolerance)) for name, each in _SIGNALS.items()}
    result = result_of_trace(limited, replay, kind=kind)
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


def _judged(signal: SignalResult, replay: TraceReplay) -> SignalResult:
    """The signal judged by its median difference over the rows with a value; where only one side has one, they are
    infinitely apart in the median, and left out of the largest difference."""
    recorded, computed = replay.recorded[signal.name], replay.replica[signal.name]
    apart = np.abs(np.asarray(recorded - computed, dtype=np.float64))
    largest = float(np.nanmax(apart, initial=0.0))
    given = np.isfinite(recorded) | np.isfinite(computed)
    median = float(np.median(np.where(np.isnan(apart), np.inf, apart)[given]))
    verdict = signal.verdict if signal.verdict == "exact" else "agrees" if median <= signal.tolerance else "differs"
    return replace(
        signal, largest_difference=largest, median_difference=median, allowance=_OF_A_FLIGHT, verdict=verdict
    )


CHECK: Final = LoopCheck(
    recordings="PX4's .ulg log of a flight, or a trace of its vertical loop with one row per estimate of position, "
    ".csv or .csv.gz",
    signals=_SIGNALS,
    figures=MappingProxyType(
        {
            "reference": ("Takeoff and velocity target", ("takeoff_state", "ramp_m_s", "out_vz_m_s")),
            "commands": ("Controller and thrust", ("out_vz_derivative", "out_az_m_s2", "out_thrust")),
        }
    ),
    note=_DOWN,
    log=Format.ULOG,
    is_trace=is_px4_trace,
    examine_log=_examine_log,
    examine_trace=_examine_trace,
)
