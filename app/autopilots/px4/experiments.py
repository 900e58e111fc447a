"""Experiments under PX4, with gains of its own controllers. Altitude steps are flown in offboard mode and scored
against the set point. The ranges of the gains are those that may be written to such a vehicle at all: a campaign
narrows them to suit its vehicle.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from app.autopilots.px4.loop import Px4Loop
from app.autopilots.px4.replica import parameters as px4_parameters
from app.core.analysis.loop import LoggedFlight, found_hover
from app.core.analysis.recorded_flight import Steps, require_channels, segment_of, whole_steps
from app.core.analysis.segment import LEAD_S
from app.core.control.parameter_checks import PLAUSIBLE, require_within
from app.core.experiments.base import Experiment, Scatter
from app.core.experiments.copter_steps import LARGEST_STEP_M, CopterSteps, copter_parameters
from app.core.experiments.step_sequence import LARGEST_PUSH_M_S2, step_options
from app.core.experiments.takeoff import CopterTakeoff, copter_gain
from app.core.models.copter import REFERENCE
from app.core.models.set_points import SetPoints
from app.core.policy import PolicySpace, Vector
from app.core.records.trajectory import Samples, Trajectory

GAINS: Final = (
    copter_gain("MPC_Z_P", "Climb rate per altitude error", "1/s", 0.1, 1.5, 1.0),
    copter_gain("MPC_Z_VEL_P_ACC", "Acceleration per climb rate error", "1/s", 2.0, 15.0, 4.0),
    copter_gain("MPC_Z_VEL_I_ACC", "Acceleration per integrated climb rate error", "1/s²", 0.2, 3.0, 2.0),
    copter_gain("MPC_Z_VEL_D_ACC", "Acceleration per measured acceleration", "", 0.0, 2.0, 0.0),
)
_LEAST_STEP_M: Final = 0.1


class Px4Steps(CopterSteps):
    """Altitude steps under PX4 in offboard mode."""

    name = "altitude-steps-px4"
    autopilot = "PX4"
    space = PolicySpace(GAINS)
    options = step_options(largest_step_m=LARGEST_STEP_M, largest_push_m_s2=LARGEST_PUSH_M_S2)
    scatter = Scatter(0.02, degrees_of_freedom=1.0, measured=False)
    """That of a few flights of the firmware's binary in its own simulation, in gusts."""
    data_sheet = copter_parameters(hover=(0.5, 0.12), slope=Px4Loop.usual_slope)

    def loop(self, gains: Vector) -> Px4Loop:
        """The loop with these gains, shape (4,), and the autopilot's parameters."""
        return px4_loop(self.parameters).with_gains(self.space.mapping(gains))

    def loop_parameters(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Those on which the loop and its estimates depend."""
        return {name: value for name, value in parameters.items() if name in px4_parameters.LOOP_NAMES}

    def read(self, trajectory: Trajectory, gains: Vector) -> LoggedFlight:
        """A flight with these gains as an analysis takes it. Raises TrajectoryError if its record does not suffice."""
        return read_px4(self.loop(gains), trajectory, self.steps)

    def references(self, steps_s: Samples) -> Samples:
        """The set points, with what is fed forward beside them; without a climb rate."""
        references = np.zeros((len(steps_s), len(REFERENCE)))
        references[:, 0] = self.set_points.at(steps_s)
        references[:, 2] = self.set_points.acceleration_at(steps_s)
        return references


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


EXPERIMENTS: Final[tuple[Experiment, ...]] = (CopterTakeoff("takeoff-px4", "PX4", GAINS), Px4Steps())
