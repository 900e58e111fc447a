"""Experiments under PX4, with gains of its own controllers. Altitude steps are flown in offboard mode and scored
against the set point. The ranges of the gains are those that may be written to such a vehicle at all: a campaign
narrows them to suit its vehicle.
"""

from collections.abc import Mapping
from typing import Final

from app.autopilots.px4.loop import Px4Loop
from app.autopilots.px4.recorded_flight import px4_loop, read_px4, straight_reference
from app.autopilots.px4.replica import parameters as px4_parameters
from app.core.analysis.flight import LoggedFlight
from app.core.experiments.base import Experiment, Scatter
from app.core.experiments.copter_steps import LARGEST_STEP_M, CopterSteps, copter_parameters
from app.core.experiments.step_sequence import LARGEST_PUSH_M_S2, step_options
from app.core.experiments.takeoff import CopterTakeoff, copter_gain
from app.core.policy import PolicySpace, Vector
from app.core.records.trajectory import Samples, Trajectory

GAINS: Final = (
    copter_gain("MPC_Z_P", "Climb rate per altitude error", "1/s", 0.1, 1.5, 1.0),
    copter_gain("MPC_Z_VEL_P_ACC", "Acceleration per climb rate error", "1/s", 2.0, 15.0, 4.0),
    copter_gain("MPC_Z_VEL_I_ACC", "Acceleration per integrated climb rate error", "1/s²", 0.2, 3.0, 2.0),
    copter_gain("MPC_Z_VEL_D_ACC", "Acceleration per measured acceleration", "", 0.0, 2.0, 0.0),
)


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
        """The set points, with what is fed forward beside them."""
        return straight_reference(self.set_points, steps_s)


EXPERIMENTS: Final[tuple[Experiment, ...]] = (CopterTakeoff("takeoff-px4", "PX4", GAINS), Px4Steps())
