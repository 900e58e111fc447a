"""Performance measures of recorded flights, on the samples' own time stamps, and how a flight follows a step of its set
point, in the terms of control engineering.

The terms are defined as in Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, section 3.4, and
ISA-51.1, with the set point as the final value.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.errors import Problem, TrajectoryError
from app.core.records.trajectory import Samples, Trajectory

RISE: Final = (0.1, 0.9)
"""Shares of the set point between which the rise time is taken."""
SETTLING_BAND: Final = 0.05
"""Half width of the band around the set point in which the output has settled, as a share of the set point."""
STEADY_S: Final = 5.0
"""The steady-state error is the mean of this last part of the window."""
MAX_GAP_S: Final = 0.25
MAX_STORED_GAP_S: Final = MAX_GAP_S + 1e-5
"""The same between stored time stamps, which are single precision: 4 µs at half a minute."""

SetPoint = Callable[[Samples], Samples]


def mean_absolute_error(time_s: Samples, values: Samples, set_point: SetPoint, start_s: float, stop_s: float) -> float:
    """Trapezoidal mean of |set point − value| over [start_s, stop_s], on the samples' own time stamps, shape (n,).

    The ends are interpolated; outside the samples the nearest value holds.
    """
    return float(mean_absolute_errors(time_s, values[np.newaxis], set_point, start_s, stop_s)[0])


def mean_absolute_errors(
    time_s: Samples, values: Samples, set_point: SetPoint, start_s: float, stop_s: float
) -> Samples:
    """The same for many records on the same time stamps: (k, n) → (k,)."""
    first, end = np.searchsorted(time_s, start_s, side="right"), np.searchsorted(time_s, stop_s, side="left")
    instants = np.concatenate(([start_s], time_s[first:end], [stop_s]))
    targets, widths = set_point(instants), np.diff(instants, prepend=start_s, append=stop_s)
    weights = 0.5 * (widths[:-1] + widths[1:]) / (stop_s - start_s)
    errors, deviation = np.empty(len(values)), np.empty(len(instants))
    for record, row in enumerate(values):
        deviation[[0, -1]] = np.interp((start_s, stop_s), time_s, row)
        deviation[1:-1] = row[first:end]
        np.abs(np.subtract(targets, deviation, out=deviation), out=deviation)
        errors[record] = np.dot(deviation, weights)
    return errors


def overshoot(time_s: Samples, values: Samples, set_point: SetPoint) -> float | None:
    """Largest excess of the output over its last set point from the command on, shape (n,); zero when it stayed below.

    None without samples after the command, and where the set point is zero, because there is no rise.
    """
    flown = values[time_s >= 0.0]
    if not flown.size:
        return None
    target = float(set_point(time_s[-1:])[0])
    return max(float(flown.max()) - target, 0.0) if target > 0.0 else None


def require_scorable(
    trajectory: Trajectory, channel: str, start_s: float, stop_s: float, *, accept_gaps: bool = False
) -> None:
    """Raise TrajectoryError unless `channel` can be scored over [start_s, stop_s].

    The channel must exist and be finite, time stamps must increase, and samples must be at most 0.25 s apart anywhere
    in the window, ends included; `accept_gaps` allows gaps inside the record.
    """
    problem = find_problem(trajectory, channel) or _uncovered(trajectory.time_s, start_s, stop_s)
    if problem is None and not accept_gaps:
        problem = _gap(trajectory.time_s, start_s, stop_s)
    if problem is not None:
        raise TrajectoryError(
            "This flight cannot be scored.",
            problems=(problem,),
            hint="Record it again, or mark the flight invalid; the raw record is kept.",
        )


def find_problem(trajectory: Trajectory, channel: str) -> Problem | None:
    """What is wrong with a recorded channel, or with the times of its samples."""
    time_s = trajectory.time_s
    if channel not in trajectory.channels:
        return Problem(channel, f"is not among the recorded channels ({', '.join(trajectory.channels)})")
    values = trajectory[channel]
    if len(values) != len(time_s):
        return Problem(channel, f"has {len(values)} samples, but there are {len(time_s)} time stamps")
    for name, column in (("time_s", time_s), (channel, values)):
        if not np.isfinite(column).all():
            return Problem(name, f"is not a finite number at sample {int(np.argmin(np.isfinite(column)))}")
    if (np.diff(time_s) <= 0.0).any():
        late = int(np.argmax(np.diff(time_s) <= 0.0)) + 1
        return Problem("time_s", f"does not increase: {time_s[late]:g} s after {time_s[late - 1]:g} s at sample {late}")
    return None


def _uncovered(time_s: Samples, start_s: float, stop_s: float) -> Problem | None:
    if not time_s.size or time_s[0] > start_s + MAX_GAP_S or time_s[-1] < stop_s - MAX_GAP_S:
        covered = f"{time_s[0]:g} … {time_s[-1]:g} s" if time_s.size else "nothing"
        return Problem("time_s", f"covers {covered}; {start_s:g} … {stop_s:g} s after the command are needed")
    return None


def _gap(time_s: Samples, start_s: float, stop_s: float) -> Problem | None:
    first = max(int(np.searchsorted(time_s, start_s, side="right")) - 1, 0)
    last = int(np.searchsorted(time_s, stop_s, side="left"))
    gaps = np.diff(time_s[first : last + 1])
    if gaps.size and gaps.max() > MAX_STORED_GAP_S:
        at = first + int(np.argmax(gaps))
        return Problem(
            "time_s", f"has a gap of {gaps.max():.3g} s after {time_s[at]:.3f} s; {MAX_GAP_S:g} s is allowed"
        )
    return None


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
