"""Experiments under ArduCopter, with gains of its own controllers. Altitude steps are scored against the target that it
shapes. The ranges of the gains are those that may be written to such a vehicle at all: a campaign narrows them to suit
its vehicle.
"""

from collections.abc import Mapping
from typing import Final

from app.autopilots.ardupilot.loop import ArduPilotLoop
from app.autopilots.ardupilot.recorded_flight import ardupilot_loop, read_ardupilot, shaped_reference
from app.autopilots.ardupilot.replica import parameters as ardupilot_parameters
from app.core.analysis.flight import LoggedFlight
from app.core.experiments.base import Experiment, Scatter
from app.core.experiments.copter_steps import CopterSteps, copter_parameters
from app.core.experiments.takeoff import CopterTakeoff, copter_gain
from app.core.policy import PolicySpace, Vector
from app.core.records.trajectory import Samples, Trajectory

GAINS: Final = (
    copter_gain("PSC_POSZ_P", "Climb rate per altitude error", "1/s", 0.1, 4.0, 1.0),
    copter_gain("PSC_VELZ_P", "Acceleration per climb rate error", "1/s", 0.5, 10.0, 5.0),
    copter_gain("PSC_ACCZ_P", "Thrust per acceleration error", "10 %·s²/m", 0.05, 2.0, 0.5),
    copter_gain("PSC_ACCZ_I", "Thrust per integrated acceleration error", "10 %·s/m", 0.2, 4.0, 1.0),
    copter_gain("PSC_ACCZ_D", "Thrust per change of acceleration error", "10 %·s³/m", 0.0, 0.4, 0.0),
)
"""Names and defaults before release 4.7; from 4.7 on the names differ, and the acceleration gains are a tenth. Without
an integral gain of the acceleration the firmware does not arm, and a wrong hover throttle is never corrected."""


class ArduPilotSteps(CopterSteps):
    """Altitude steps under ArduCopter."""

    name = "altitude-steps-ardupilot"
    autopilot = "ArduCopter"
    space = PolicySpace(GAINS)
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


EXPERIMENTS: Final[tuple[Experiment, ...]] = (
    CopterTakeoff("takeoff-ardupilot", "ArduCopter", GAINS),
    ArduPilotSteps(),
)
