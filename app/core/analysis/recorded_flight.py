"""A flight of altitude steps over a link as an analysis takes it: what the vehicle reported, and its parameters.

The record has altitude, climb rate, the throttle that the loop demanded, and its reference; not the acceleration, nor
the rates of the reference. The acceleration is the change of the climb rate over a row, and the rates follow from the
set points: ArduCopter's reference is shaped again by the loop's own replica, with each set point at the time at which
it fits the recorded reference best; PX4's is the set point itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from app.core.analysis.ardupilot_loop import ArduPilotLoop
from app.core.analysis.flight import LoggedFlight
from app.core.analysis.hover import found_hover
from app.core.analysis.px4_loop import Px4Loop
from app.core.analysis.segment import LEAD_S, FinerSegment
from app.core.control import ardupilot_parameters, px4_parameters
from app.core.control.parameter_checks import PLAUSIBLE, require_within
from app.core.errors import Problem, TrajectoryError
from app.core.models.ardupilot_copter import shaped
from app.core.models.copter import REFERENCE, filtered
from app.core.models.set_points import SetPoints
from app.core.records.trajectory import Samples, Trajectory

_ROW_S: Final = 0.1
CHANNELS: Final = ("altitude_m", "climb_rate_m_s", "throttle", "reference_m")
LARGEST_INTERVAL_S: Final = 0.06
_THROTTLE_HZ: Final = 2.0
_LATENESS_S: Final = (np.arange(-0.2, 1.2, 0.05), np.arange(-0.05, 0.051, 0.01))
"""How late a set point may take effect, coarsely, then beside the best of these."""
_LARGEST_MISFIT_M: Final = 0.1
_LEAST_VARIATION: Final = 1e-6
_LEAST_STEP_M: Final = 0.1
_RANGES: Final = {
    **dict.fromkeys(ardupilot_parameters.FIRMWARE_NAMES, PLAUSIBLE),
    ardupilot_parameters.LOOP_RATE: ardupilot_parameters.LOOP_RATES_HZ,
    ardupilot_parameters.ACCELEROMETER_FILTER: (0.0, ardupilot_parameters.LOOP_RATES_HZ[1]),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """The scored steps of a flight: its set points, and the scored time, s since the command."""

    set_points: SetPoints
    begin_s: float
    end_s: float

    def rows_s(self, row_s: float) -> Samples:
        """Times of the rows, from the lead before the first step to the end, shape (n,)."""
        return np.linspace(self.begin_s - LEAD_S, self.end_s, round((self.end_s - self.begin_s + LEAD_S) / row_s) + 1)

    def steps_s(self, step_s: float) -> Samples:
        """Times of the loop's steps over the same time, shape (m,)."""
        return np.arange(self.begin_s - LEAD_S, self.end_s, step_s)


def ardupilot_loop(parameters: Mapping[str, float]) -> ArduPilotLoop:
    """The loop with the vehicle's parameters by the names of its release; those missing have their default.

    Raises InputError for one that the replica lacks, or that is outside its range.
    """
    given = dict(ardupilot_parameters.in_older_names(*each) for each in parameters.items())
    require_within(given, _RANGES)
    step_s = 1.0 / given.get(ardupilot_parameters.LOOP_RATE, ardupilot_parameters.LOOP_RATE_HZ)
    return ArduPilotLoop(
        parameters=ardupilot_parameters.parameters_from(given),
        filter_hz=given.get(ardupilot_parameters.ACCELEROMETER_FILTER, ardupilot_parameters.ACCELEROMETER_FILTER_HZ),
        step_s=step_s,
        row_s=_whole_steps(step_s),
    )


def px4_loop(parameters: Mapping[str, float]) -> Px4Loop:
    """The same for PX4."""
    require_within(parameters, dict.fromkeys(px4_parameters.FIRMWARE_NAMES, PLAUSIBLE))
    given, step_s = px4_parameters.parameters_from(parameters), px4_parameters.estimator_step_s(parameters)
    return Px4Loop(
        parameters=given,
        step_s=step_s,
        row_s=_whole_steps(step_s),
        descent_m_s=given.descent_m_s,
        hover_deviation=px4_parameters.hover_deviation(parameters),
    )


def _whole_steps(step_s: float) -> float:
    """A tenth of a second in whole steps."""
    return round(_ROW_S / step_s) * step_s


def shaped_reference(loop: ArduPilotLoop, set_points: SetPoints, steps_s: Samples) -> Samples:
    """ArduCopter's reference at the times of its steps, shape (m, 4) as `REFERENCE`, from rest at the set point before
    the first of them."""
    references = np.full((len(steps_s), len(REFERENCE)), loop.assumed_hover_throttle)
    targets = set_points.at(steps_s)
    shaped(loop.parameters.packed(loop.step_s), targets[0], targets, references)
    return references


def straight_reference(set_points: SetPoints, steps_s: Samples) -> Samples:
    """PX4's reference at the times of its steps, shape (m, 4): the set point and what is fed forward beside it, without
    a climb rate and a hover throttle."""
    references = np.zeros((len(steps_s), len(REFERENCE)))
    references[:, 0] = set_points.at(steps_s)
    references[:, 2] = set_points.acceleration_at(steps_s)
    return references


def read_ardupilot(loop: ArduPilotLoop, trajectory: Trajectory, steps: Steps) -> LoggedFlight:
    """The flight of a trajectory with these channels, from 2 s before the first step to the end.

    Raises TrajectoryError if a channel is missing or too sparse, and if the reference is not the one that the loop
    shapes.
    """
    _require_channels(trajectory, steps)
    rows_s, steps_s = steps.rows_s(_whole_steps(loop.step_s)), steps.steps_s(loop.step_s)
    reference = shaped_reference(loop, _on_time(loop, trajectory, steps), steps_s)
    z_d, v_d, a_d = (np.interp(rows_s, steps_s, reference[:, column]) for column in range(3))
    demanded = np.interp(steps_s, trajectory.time_s, trajectory["throttle"])
    gain = ardupilot_parameters.low_pass_gain(_THROTTLE_HZ, loop.step_s)
    sent = filtered(demanded, (np.array([gain]), np.array([1.0, gain - 1.0])))
    scored = (trajectory.time_s >= steps.begin_s) & (trajectory.time_s <= steps.end_s)
    moved = trajectory["throttle"] - np.interp(trajectory.time_s, steps_s, sent)
    return LoggedFlight(
        loop=loop,
        segments=[
            _segment(trajectory, rows_s, (z_d, v_d, a_d), steps_s, sent, np.full(len(rows_s), np.nan)),
        ],
        activity=float(np.std(moved[scored])),
    )


def read_px4(loop: Px4Loop, trajectory: Trajectory, steps: Steps) -> LoggedFlight:
    """The same for PX4, whose loop assumes the hover throttle that its own estimator finds: the mean of the flight,
    within the estimator's limits."""
    _require_channels(trajectory, steps)
    rows_s, steps_s = steps.rows_s(loop.row_s), steps.steps_s(loop.step_s)
    z_d = np.interp(rows_s, trajectory.time_s, trajectory["reference_m"])
    still = np.zeros(len(rows_s))
    pushed = steps.set_points.acceleration_at(rows_s - _lateness_s(trajectory, steps.set_points))
    sent = np.interp(steps_s, trajectory.time_s, trajectory["throttle"])
    hover = np.full(len(rows_s), found_hover(loop, float(sent.mean())))
    return LoggedFlight(loop=loop, segments=[_segment(trajectory, rows_s, (z_d, still, pushed), steps_s, sent, hover)])


def _lateness_s(trajectory: Trajectory, set_points: SetPoints) -> float:
    """How late the steps took effect on average, by the recorded reference; 0 if it does not show all of them, or there
    are none."""
    nominal = np.array(set_points.times_s[1:])[np.diff(set_points.altitudes_m) != 0.0]
    if not nominal.size:
        return 0.0
    after = trajectory.time_s[1:] >= nominal[0] - LEAD_S
    flown = trajectory.time_s[1:][(np.abs(np.diff(trajectory["reference_m"])) > _LEAST_STEP_M) & after]
    return float(np.mean(flown - nominal)) if len(flown) == len(nominal) else 0.0


def _segment(
    trajectory: Trajectory,
    rows_s: Samples,
    reference: tuple[Samples, Samples, Samples],
    steps_s: Samples,
    sent: Samples,
    assumed_hover: Samples,
) -> FinerSegment:
    """`sent` is what the motors get at `steps_s`, shape (m,) each. The climb rate target is not known."""
    z_m, v_m_s, throttle = (np.interp(rows_s, trajectory.time_s, trajectory[name]) for name in CHANNELS[:3])
    changes = np.diff(v_m_s) / np.diff(rows_s)
    z_d, v_d, a_d = reference
    before_end = steps_s < rows_s[-1]
    return FinerSegment(
        time_s=rows_s,
        z_m=z_m,
        v_m_s=v_m_s,
        a_m_s2=np.append(changes[0], changes),
        z_d_m=z_d,
        v_d_m_s=v_d,
        a_d_m_s2=a_d,
        v_t_m_s=np.full(len(rows_s), np.nan),
        throttle=throttle,
        throttle_filtered=np.interp(rows_s, steps_s, sent),
        assumed_hover=assumed_hover,
        motor_time_s=np.append(steps_s[before_end], rows_s[-1]),
        motor_values=np.append(sent[before_end], sent[-1]),
    )


def _on_time(loop: ArduPilotLoop, trajectory: Trajectory, steps: Steps) -> SetPoints:
    """The set points at the times at which the recorded reference shows them, found one after the other."""
    found, misfit_m = steps.set_points, 0.0
    for place, end_s in enumerate((*found.times_s[2:], steps.end_s), start=1):
        time_s = found.times_s[place]
        misfit = partial(_misfit, loop, trajectory, steps, found, place, (time_s, end_s))
        for lateness_s in _LATENESS_S:
            time_s = min((time_s + lateness_s).tolist(), key=misfit)
        found, misfit_m = _with_time(found, place, time_s), max(misfit_m, misfit(time_s))
    if misfit_m > _LARGEST_MISFIT_M:
        raise _unanswered(
            "reference_m",
            f"differs by {misfit_m:.2f} m from the target that ArduCopter shapes from the set points with the "
            "vehicle's parameters",
        )
    return found


def _with_time(set_points: SetPoints, place: int, time_s: float) -> SetPoints:
    times_s = set_points.times_s
    return replace(set_points, times_s=(*times_s[:place], time_s, *times_s[place + 1 :]))


def _misfit(
    loop: ArduPilotLoop,
    trajectory: Trajectory,
    steps: Steps,
    set_points: SetPoints,
    place: int,
    window_s: tuple[float, float],
    time_s: float,
) -> float:
    """R.m.s. distance, m, of the shaped reference from the recorded one within a window, if the set point at `place`
    takes effect at `time_s`."""
    steps_s = np.arange(steps.begin_s - LEAD_S, window_s[1], loop.step_s)
    within = steps_s >= window_s[0]
    shaped_m = shaped_reference(loop, _with_time(set_points, place, time_s), steps_s)[within, 0]
    recorded_m = np.interp(steps_s[within], trajectory.time_s, trajectory["reference_m"])
    return float(np.sqrt(np.mean((shaped_m - recorded_m) ** 2)))


def _require_channels(trajectory: Trajectory, steps: Steps) -> None:
    for name in CHANNELS:
        if name not in trajectory.channels:
            raise _unanswered(name, f"is not among the recorded channels ({', '.join(trajectory.channels)})")
    within = (trajectory.time_s >= steps.begin_s - LEAD_S) & (trajectory.time_s <= steps.end_s)
    if np.ptp(trajectory["throttle"][within]) < _LEAST_VARIATION:
        raise _unanswered("throttle", "is constant: nothing can be learned from it")
    interval_s = float(np.median(np.diff(trajectory.time_s[within])))
    if interval_s > LARGEST_INTERVAL_S:
        raise _unanswered("time_s", f"has a sample every {interval_s:.2f} s; {LARGEST_INTERVAL_S:g} s are needed")


def _unanswered(field: str, reason: str) -> TrajectoryError:
    return TrajectoryError(
        "This flight cannot be fitted.",
        hint="Request the vehicle's position, throttle and reference at 50 Hz.",
        problems=(Problem(field, reason),),
    )
