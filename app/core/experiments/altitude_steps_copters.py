"""Steps of the altitude set point in flight, under ArduCopter and PX4, with gains of their own controllers.

ArduCopter is scored against the target that it shapes, PX4 against the set point. The ranges of the gains are those
that may be written to such a vehicle at all: a campaign narrows them to suit its vehicle.
"""

from collections.abc import Mapping

from app.core.analysis.ardupilot_loop import ArduPilotLoop
from app.core.analysis.flight import LoggedFlight
from app.core.analysis.px4_loop import Px4Loop
from app.core.analysis.recorded_flight import (
    ardupilot_loop,
    px4_loop,
    read_ardupilot,
    read_px4,
    shaped_reference,
    straight_reference,
)
from app.core.control import ardupilot_parameters, px4_parameters
from app.core.experiments.base import Scatter
from app.core.experiments.copter_steps import LARGEST_STEP_M, CopterSteps, copter_parameters
from app.core.experiments.step_sequence import LARGEST_PUSH_M_S2, step_options
from app.core.experiments.takeoff import ARDUPILOT_GAINS, PX4_GAINS
from app.core.policy import PolicySpace, Vector
from app.core.records.trajectory import Samples, Trajectory


class ArduPilotSteps(CopterSteps):
    """Altitude steps under ArduCopter."""

    name = "altitude-steps-ardupilot"
    autopilot = "ArduCopter"
    space = PolicySpace(ARDUPILOT_GAINS)
    scatter = Scatter(0.003, degrees_of_freedom=1.0, measured=False)
    """That of a few flights of the firmware's binary in its own simulation, in gusts."""
    data_sheet = copter_parameters(hover=(0.35, 0.12), slope=ArduPilotLoop.usual_slope)

    def loop(self, gains: Vector) -> ArduPilotLoop:
        """The loop with these gains, shape (5,), and the autopilot's parameters."""
        return ardupilot_loop(self.parameters).with_gains(self.space.mapping(gains))

    def loop_parameters(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Those on which the loop depends, by the names until release 4.6."""
        older = dict(ardupilot_parameters.in_older_names(*each) for each in parameters.items())
        return {name: value for name, value in older.items() if name in ardupilot_parameters.LOOP_NAMES}

    def read(self, trajectory: Trajectory, gains: Vector) -> LoggedFlight:
        """A flight with these gains as an analysis takes it. Raises TrajectoryError if its record does not suffice."""
        return read_ardupilot(self.loop(gains), trajectory, self.steps)

    def references(self, steps_s: Samples) -> Samples:
        """The target that the loop shapes."""
        return shaped_reference(self.loop(self.space.default), self.set_points, steps_s)


class Px4Steps(CopterSteps):
    """Altitude steps under PX4 in offboard mode."""

    name = "altitude-steps-px4"
    autopilot = "PX4"
    space = PolicySpace(PX4_GAINS)
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
