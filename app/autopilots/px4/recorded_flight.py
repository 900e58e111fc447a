"""A flight of altitude steps under PX4 over a link: its reference is the set point itself."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from app.autopilots.px4.loop import Px4Loop
from app.autopilots.px4.replica import parameters as px4_parameters
from app.core.analysis.flight import LoggedFlight
from app.core.analysis.hover import found_hover
from app.core.analysis.recorded_flight import Steps, require_channels, segment_of, whole_steps
from app.core.analysis.segment import LEAD_S
from app.core.control.parameter_checks import PLAUSIBLE, require_within
from app.core.models.copter import REFERENCE
from app.core.models.set_points import SetPoints
from app.core.records.trajectory import Samples, Trajectory

_LEAST_STEP_M: Final = 0.1


def px4_loop(parameters: Mapping[str, float]) -> Px4Loop:
    """The loop with the vehicle's parameters; those missing have their default.

    Raises InputError for one that the replica lacks, or that is outside its range.
    """
    require_within(parameters, dict.fromkeys(px4_parameters.DEFAULTS, PLAUSIBLE))
    given, step_s = px4_parameters.parameters_from(parameters), px4_parameters.estimator_step_s(parameters)
    return Px4Loop(
        parameters=given,
        step_s=step_s,
        row_s=whole_steps(step_s),
        descent_m_s=given.descent_m_s,
        hover_deviation=px4_parameters.hover_deviation(parameters),
    )


def straight_reference(set_points: SetPoints, steps_s: Samples) -> Samples:
    """Its reference at the times of its steps, shape (m, 4): the set point and what is fed forward beside it, without
    a climb rate and a hover throttle."""
    references = np.zeros((len(steps_s), len(REFERENCE)))
    references[:, 0] = set_points.at(steps_s)
    references[:, 2] = set_points.acceleration_at(steps_s)
    return references


def read_px4(loop: Px4Loop, trajectory: Trajectory, steps: Steps) -> LoggedFlight:
    """The flight of a trajectory with these channels, from 2 s before the first step to the end. The loop assumes the
    hover throttle that its own estimator finds: the mean of the flight, within the estimator's limits.

    Raises TrajectoryError if a channel is missing or too sparse.
    """
    require_channels(trajectory, steps)
    rows_s, steps_s = steps.rows_s(loop.row_s), steps.steps_s(loop.step_s)
    z_d = np.interp(rows_s, trajectory.time_s, trajectory["reference_m"])
    still = np.zeros(len(rows_s))
    pushed = steps.set_points.acceleration_at(rows_s - _lateness_s(trajectory, steps.set_points))
    sent = np.interp(steps_s, trajectory.time_s, trajectory["throttle"])
    hover = np.full(len(rows_s), found_hover(loop, float(sent.mean())))
    return LoggedFlight(
        loop=loop, segments=[segment_of(trajectory, rows_s, (z_d, still, pushed), steps_s, sent, hover)]
    )


def _lateness_s(trajectory: Trajectory, set_points: SetPoints) -> float:
    """How late the steps took effect on average, by the recorded reference; 0 if it does not show all of them, or there
    are none."""
    nominal = np.array(set_points.times_s[1:])[np.diff(set_points.altitudes_m) != 0.0]
    if not nominal.size:
        return 0.0
    after = trajectory.time_s[1:] >= nominal[0] - LEAD_S
    flown = trajectory.time_s[1:][(np.abs(np.diff(trajectory["reference_m"])) > _LEAST_STEP_M) & after]
    return float(np.mean(flown - nominal)) if len(flown) == len(nominal) else 0.0
