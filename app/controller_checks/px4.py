"""PX4's entry in the registry: traces with a row per estimate of position, of the loop alone or of a flight."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from app.controller_checks.autopilot import Autopilot, Beginning, Recording
from app.controller_checks.results import Result, Signal, SignalResult, TraceReplay, grouped, result_of_trace
from app.core.control.px4 import OUTPUTS
from app.core.control.px4_replay import LoopTrace, replayed
from app.logs.px4_trace import is_px4_trace, read_px4_trace

_TOLERANCE: Final = 1e-5


def _signal(title: str, unit: str, digits: int) -> Signal:
    allowance = "firmware and replica compute in single precision"
    return Signal(
        title=title, unit=unit, difference_unit=unit, digits=digits, tolerance=_TOLERANCE, allowance=allowance
    )


_SIGNALS: Final[Mapping[str, Signal]] = MappingProxyType(
    {
        "takeoff_state": _signal("State of the takeoff", "", 0),
        "out_vz_m_s": _signal("Velocity target", "m/s", 3),
        "out_az_m_s2": _signal("Acceleration target", "m/s²", 3),
        "out_thrust": _signal("Thrust", "of full", 4),
        "ramp_m_s": _signal("Limit of the climb rate", "m/s", 3),
        "out_vz_derivative": _signal("Derivative of the velocity", "m/s²", 3),
    }
)
_MEDIANS: Final[Mapping[str, float]] = MappingProxyType(
    {"takeoff_state": _TOLERANCE, "out_vz_m_s": 1e-6, "out_az_m_s2": 2e-2, "out_thrust": 1e-3}
)
"""What the median difference of a signal over a flight may be."""

_OF_A_FLIGHT: Final = "the median over the flight; single rows are undecided where messages share a time stamp"
_DOWN: Final = "Altitude, velocity and acceleration are positive down, as in PX4."


def _recognises(beginning: Beginning) -> bool:
    return is_px4_trace(beginning.unzipped)


def _examine(recording: Recording) -> Result:
    trace = read_px4_trace(recording.stream, name=recording.name)
    replay = _replayed(trace)
    result = result_of_trace(PX4.name, _SIGNALS, replay)
    return _judged_by_medians(result, replay) if trace.flown else result


def _replayed(trace: LoopTrace) -> TraceReplay:
    recorded = dict(zip(OUTPUTS, trace.outputs.T, strict=True))
    computed = dict(zip(OUTPUTS, replayed(trace).T, strict=True))
    compared = [name for name, values in recorded.items() if not np.isnan(values).all()]
    return TraceReplay(
        time_s=trace.time_s,
        recorded={name: recorded[name] for name in compared},
        replica={name: computed[name] for name in compared},
        gains=trace.parameters.gains,
        notes=(_DOWN,),
    )


def _judged_by_medians(result: Result, replay: TraceReplay) -> Result:
    judged = [_judged(signal, replay) for signal in result.signals if signal.name in _MEDIANS]
    signals = tuple(signal for signal, _ in judged)
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
        notes=(*_notes(judged), *result.notes),
        first_different_row=result.first_different_row if differing else None,
    )


def _judged(signal: SignalResult, replay: TraceReplay) -> tuple[SignalResult, float]:
    """The signal judged by its median difference, and the median; rows where only one side has a value are infinitely
    apart in the median, and left out of the largest difference."""
    recorded, computed = replay.recorded[signal.name], replay.replica[signal.name]
    apart = np.abs(np.asarray(recorded - computed, dtype=np.float64))
    largest = float(np.nanmax(apart, initial=0.0))
    apart[np.isnan(recorded) & np.isnan(computed)] = 0.0
    median = float(np.median(np.where(np.isnan(apart), np.inf, apart)))
    limit = _MEDIANS[signal.name]
    verdict = signal.verdict if signal.verdict == "exact" else "agrees" if median <= limit else "differs"
    judged = replace(signal, largest_difference=largest, tolerance=limit, allowance=_OF_A_FLIGHT, verdict=verdict)
    return judged, median


def _notes(judged: Iterable[tuple[SignalResult, float]]) -> Iterable[str]:
    for signal, median in judged:
        limit = f"{signal.tolerance:g} {signal.difference_unit}".strip()
        yield f"{signal.name}: median difference {median:.2g}, at most {limit}."


PX4: Final = Autopilot(
    name="px4",
    title="PX4",
    recordings="a trace of PX4's vertical loop with one row per estimate of position, .csv or .csv.gz",
    signals=_SIGNALS,
    figures=MappingProxyType(
        {
            "reference": ("Takeoff and velocity target", ("takeoff_state", "ramp_m_s", "out_vz_m_s")),
            "commands": ("Controller and thrust", ("out_vz_derivative", "out_az_m_s2", "out_thrust")),
        }
    ),
    note=_DOWN,
    recognises=_recognises,
    examine=_examine,
)
