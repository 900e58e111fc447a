"""The transient of a recorded flight: how a step of the set point is followed, in the terms of control engineering.

Definitions as in Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, section 3.4, and ISA-51.1, with
the set point as the final value.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.records.metrics import MAX_GAP_S, SetPoint, overshoot
from app.core.records.trajectory import Samples

RISE: Final = (0.1, 0.9)
"""Shares of the set point between which the rise time is taken."""
SETTLING_BAND: Final = 0.05
"""Half width of the band around the set point in which the output has settled, as a share of the set point."""
STEADY_S: Final = 5.0
"""The steady-state error is the mean of this last part of the window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResponse:
    """Response of the output to a step of its set point from zero at the command.

    `rise_time_s`: from when the output first reaches 10 % of the set point to when it first reaches 90 %.
    `settling_time_s`: from the command until the output stays within ±5 % of the set point to the end of the window.
    `overshoot`: the largest excess over the set point, in the output's unit, zero if there is none.
    `steady_state_error`: mean of output − set point over the last 5 s of the window, in the output's unit; positive
    above the set point.

    The rise time is None if 90 % was never reached. The settling time is None if the output was outside the band at the
    end of the window. If the record ends before the window does, settling time and steady-state error are None, and so
    is the overshoot unless the set point was reached.
    """

    rise_time_s: float | None
    settling_time_s: float | None
    overshoot: float | None
    steady_state_error: float | None


def step_response(time_s: Samples, values: Samples, set_point: SetPoint, stop_s: float) -> StepResponse | None:
    """The step response over [0, stop_s] of an output with increasing time stamps, both of shape (n,).

    Times between samples are interpolated. None without two samples in the window, and where the set point is zero or
    changes within the window.
    """
    excess = overshoot(time_s, values, set_point)
    inside = (time_s >= 0.0) & (time_s <= stop_s)
    at, output = time_s[inside], values[inside]
    if excess is None or len(at) < 2 or np.ptp(set_point(at)) > 0.0:
        return None
    target = float(set_point(time_s[-1:])[0])
    low, high = (_first_reached(at, output, share * target) for share in RISE)
    covered = float(time_s[-1]) >= stop_s - MAX_GAP_S
    return StepResponse(
        rise_time_s=None if low is None or high is None else high - low,
        settling_time_s=_settled(at, output - target, SETTLING_BAND * target) if covered else None,
        overshoot=excess if covered or output.max() >= target else None,
        steady_state_error=_mean(at, output - target, stop_s - STEADY_S) if covered else None,
    )


def _first_reached(time_s: Samples, values: Samples, level: float) -> float | None:
    """Time at which the values first reach the level."""
    reached = np.flatnonzero(values >= level)
    if not reached.size:
        return None
    return _crossing(time_s, values, max(int(reached[0]) - 1, 0), level)


def _settled(time_s: Samples, deviations: Samples, band: float) -> float | None:
    """Time from which on the deviations stay within ± `band`."""
    outside = np.flatnonzero(np.abs(deviations) > band)
    if not outside.size:
        return float(time_s[0])
    last = int(outside[-1])
    if last == len(time_s) - 1:
        return None
    return _crossing(time_s, np.abs(deviations), last, band)


def _crossing(time_s: Samples, values: Samples, index: int, level: float) -> float:
    """Time at which the line from sample `index` to the next one crosses the level; that of the sample if flat."""
    first, second = (float(value) for value in values[index : index + 2])
    start, end = (float(value) for value in time_s[index : index + 2])
    share = 0.0 if first == second else (level - first) / (second - first)
    return start + min(max(share, 0.0), 1.0) * (end - start)


def _mean(time_s: Samples, values: Samples, start_s: float) -> float:
    """Trapezoidal mean from `start_s` to the last sample."""
    last = time_s >= start_s
    if np.count_nonzero(last) < 2:
        return float(values[-1])
    return float(np.trapezoid(values[last], time_s[last])) / float(time_s[last][-1] - time_s[last][0])
