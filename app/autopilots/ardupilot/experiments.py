"""Experiments under ArduCopter, with gains of its own controllers. Altitude steps are scored against the target that it
shapes. The ranges of the gains are those that may be written to such a vehicle at all: a campaign narrows them to suit
its vehicle.

The reference of a flight of steps is shaped again by the loop's own replica, with each set point at the time at which
it fits the recorded reference best.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from app.autopilots.ardupilot.loop import ArduPilotLoop
from app.autopilots.ardupilot.replica import parameters as ardupilot_parameters
from app.autopilots.ardupilot.replica.copter import shaped
from app.autopilots.ardupilot.replica.vertical import packed
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.recorded_flight import Steps, require_channels, segment_of, unanswered, whole_steps
from app.core.analysis.segment import LEAD_S
from app.core.control.parameter_checks import PLAUSIBLE, require_within
from app.core.experiments.base import Experiment, Scatter
from app.core.experiments.copter_steps import CopterSteps, copter_parameters
from app.core.experiments.takeoff import CopterTakeoff, copter_gain
from app.core.models.copter import REFERENCE, filtered
from app.core.models.set_points import SetPoints
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
_THROTTLE_HZ: Final = 2.0
_LATENESS_S: Final = (np.arange(-0.2, 1.2, 0.05), np.arange(-0.05, 0.051, 0.01))
"""How late a set point may take effect, coarsely, then beside the best of these."""
_LARGEST_MISFIT_M: Final = 0.1
_RANGES: Final = {
    **dict.fromkeys(ardupilot_parameters.DEFAULTS, PLAUSIBLE),
    ardupilot_parameters.LOOP_RATE: ardupilot_parameters.LOOP_RATES_HZ,
    ardupilot_parameters.ACCELEROMETER_FILTER: (0.0, ardupilot_parameters.LOOP_RATES_HZ[1]),
}


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
        row_s=whole_steps(step_s),
    )


def shaped_reference(loop: ArduPilotLoop, set_points: SetPoints, steps_s: Samples) -> Samples:
    """Its reference at the times of its steps, shape (m, 4) as `REFERENCE`, from rest at the set point before
    the first of them."""
    references = np.full((len(steps_s), len(REFERENCE)), loop.assumed_hover_throttle)
    targets = set_points.at(steps_s)
    shaped(packed(loop.parameters, loop.step_s), targets[0], targets, references)
    return references


def read_ardupilot(loop: ArduPilotLoop, trajectory: Trajectory, steps: Steps) -> LoggedFlight:
    """The flight of a trajectory with these channels, from 2 s before the first step to the end.

    Raises TrajectoryError if a channel is missing or too sparse, and if the reference is not the one that the loop
    shapes.
    """
    require_channels(trajectory, steps)
    rows_s, steps_s = steps.rows_s(whole_steps(loop.step_s)), steps.steps_s(loop.step_s)
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
            segment_of(trajectory, rows_s, (z_d, v_d, a_d), steps_s, sent, np.full(len(rows_s), np.nan)),
        ],
        activity=float(np.std(moved[scored])),
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
        raise unanswered(
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


EXPERIMENTS: Final[tuple[Experiment, ...]] = (
    CopterTakeoff("takeoff-ardupilot", "ArduCopter", GAINS),
    ArduPilotSteps(),
)
