"""ArduCopter's altitude loop as an analysis takes it, and experiments with gains of its own controllers. Altitude steps
are scored against the target that it shapes. The ranges of the gains are those that may be written to such a vehicle at
all: a campaign narrows them to suit its vehicle.

The reference of a flight of steps is shaped again by the loop's own replica, with each set point at the time at which
it fits the recorded reference best.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Final

import numpy as np

from app.autopilots.ardupilot.replica import vertical
from app.autopilots.ardupilot.replica.parameters import (
    ACCELEROMETER_FILTER,
    ACCELEROMETER_FILTER_HZ,
    DEFAULTS,
    LOOP_NAMES,
    LOOP_RATE,
    LOOP_RATE_HZ,
    LOOP_RATES_HZ,
    Parameters,
    in_newer_names,
    in_older_names,
    low_pass_gain,
    parameters_from,
)
from app.autopilots.ardupilot.replica.replay import climb_rate_targets
from app.autopilots.copter_loop import CopterLoop
from app.autopilots.parameter_file import NAMES_AND_VALUES
from app.core.analysis.loop import GainSpace, LoggedFlight, LoopTexts, Run, mean_over, transition_of
from app.core.analysis.recorded_flight import FlownSteps, require_channels, segment_of, unanswered, whole_steps
from app.core.analysis.segment import LEAD_S, Segment, Steps
from app.core.control.parameter_checks import PLAUSIBLE, require_within
from app.core.experiments.base import Experiment, Scatter
from app.core.experiments.copter_steps import CopterSteps, copter_parameters
from app.core.experiments.takeoff import CopterTakeoff, copter_gain
from app.core.models.copter import (
    DISTURBANCES,
    FLOWN,
    HOVER_THROTTLE,
    REFERENCE,
    Copter,
    Filter,
    accelerometer_filter,
    filtered,
    low_pass,
    start_body,
)
from app.core.models.set_points import SetPoints
from app.core.policy import PolicySpace, Vector
from app.core.reasons import Reason, ReasonCode
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
_LATENESS_S: Final = (np.arange(-0.2, 1.2, 0.05), np.arange(-0.05, 0.051, 0.01))
"""How late a set point may take effect, coarsely, then beside the best of these."""
_LARGEST_MISFIT_M: Final = 0.1
_AT_REST_M_S: Final = 1e-3
_DYNAMIC: Final = [
    vertical.THROTTLE,
    vertical.THROTTLE_FILTERED,
    vertical.VELOCITY_ERROR,
    vertical.VELOCITY_DERIVATIVE,
    vertical.VELOCITY_SUM,
    vertical.FILTERED_TARGET,
    vertical.ACCELERATION_ERROR,
    vertical.ACCELERATION_DERIVATIVE,
    vertical.ACCELERATION_SUM,
]
"""What the loop remembers from one step to the next, on a reference at rest."""

_NUDGE: Final = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class ArduPilotLoop(CopterLoop):
    """The loop (`AltitudeLoop`). `filter_hz` is the cut-off of the accelerometer's filter. `names` are those that the
    vehicle has for parameters instead of the names of releases 4.0 to 4.6, with the factor to its unit. Until 4.0 the
    loop `differentiates` its climb rate target, instead of shaping an acceleration. The acceleration in the log is the
    sensed one, or the change of the climb rate over `row_s`, a whole number of steps."""

    parameters: Parameters
    filter_hz: float
    names: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    differentiates: bool = False
    row_s: float | None = None

    texts = LoopTexts(
        autopilot="ArduCopter",
        prefix="PSC_",
        hover_parameter="MOT_THST_HOVER",
        hover_range=(vertical.HOVER_MIN, vertical.HOVER_MAX),
        hover_use=(
            "the integral has to make up for the difference after every takeoff, and with MOT_HOVER_LEARN at 0, as in "
            "a campaign, the parameter stays as it is"
        ),
        fast_gains="P and I of the acceleration controller",
        lateness="lag",
        what_to_fly=(
            "Fly at a height of 3 m or more in a mode that holds altitude (GUIDED, LOITER, ALT_HOLD, AUTO): hover for "
            "5 s, climb 2 m, hover for 5 s, descend 2 m, hover for 5 s; with NTUN and CTUN in LOG_BITMASK."
        ),
        lags="motors, accelerometer filter, acceleration controller filters",
        parameter_suffix=NAMES_AND_VALUES.suffix,
    )
    space = GainSpace(
        bounds=MappingProxyType(
            {
                "PSC_POSZ_P": (1.0, 3.0),
                "PSC_VELZ_P": (1.0, 8.0),
                "PSC_ACCZ_P": (0.2, 1.5),
                "PSC_ACCZ_I": (0.2, 3.0),
            }
        ),
        gentle=MappingProxyType({"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.2, "PSC_ACCZ_I": 0.2}),
        ordered=("PSC_ACCZ_P", "PSC_ACCZ_I"),
    )
    """An integral gain below 0.2 fails the arming check."""
    fast = ("PSC_ACCZ_P", "PSC_ACCZ_I", "PSC_ACCZ_D", "PSC_ACCZ_FF")
    compared = ((2.0, 7.0, 1.0, 2.0), (3.0, 8.0, 0.5, 3.0))
    throttle_limits = (0.0, 1.0)
    usual_slope = (1.0, 0.25)
    slope_error = 0.0
    target_tolerance_m_s = 0.02
    hover_limits = None

    @property
    def firmware_parameters(self) -> dict[str, float]:
        return self.parameters.named | {LOOP_RATE: 1.0 / self.step_s, ACCELEROMETER_FILTER: self.filter_hz}

    @property
    def accelerometer(self) -> Filter:
        return self.sensor if self.row_s is None else mean_over(self.row_s, self.step_s)

    @property
    def sensor(self) -> Filter:
        return accelerometer_filter(self.filter_hz, self.step_s)

    def named(self, gains: Mapping[str, float]) -> dict[str, float]:
        return in_newer_names(gains, self.names)

    def documented(self, hover_throttle: float) -> dict[str, dict[str, float]]:
        p, i = (float(f"{factor * hover_throttle:.2g}") for factor in (1.0, 2.0))
        factor = self.names.get("PSC_ACCZ_P", ("", 1.0))[1]
        name = f"P = {'' if factor == 1.0 else f'{factor:g} '}hover throttle, I = 2 P"
        return {name: {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": p, "PSC_ACCZ_I": i}}

    def parameter_lines(self, flown: Mapping[str, float], proposed: Mapping[str, float]) -> list[str]:
        return NAMES_AND_VALUES.changes(flown, proposed)

    def climb_rate_targets(self, segment: Segment) -> Samples:
        """A reference at rest has no desired climb rate, even where that was not logged."""
        desired = np.where(np.abs(segment.moves_m_s) < _AT_REST_M_S, 0.0, segment.v_d_m_s)
        return climb_rate_targets(self.parameters, segment.z_d_m - segment.z_m, desired)

    def excitation(self, segment: Segment, throttle: float) -> tuple[Samples, Samples]:  # noqa: ARG002
        """Those of the reference, which the loop shapes itself; before, those of a vehicle that has each climb rate at
        once."""
        if not self.differentiates:
            return segment.v_d_m_s, segment.a_d_m_s2
        p = self.parameters.position_p_1_s
        sought_m = segment.z_d_m - segment.z_d_m[0] + segment.v_d_m_s / p
        gain = -np.expm1(-p * np.median(np.diff(segment.time_s)))
        v_m_s = p * (sought_m - filtered(sought_m, low_pass(gain)))
        return v_m_s, np.gradient(v_m_s, segment.time_s)

    def start(self, steps: Steps) -> tuple[float, float]:
        _, v_d, a_d, _ = steps.reference[0].tolist()
        return v_d, a_d

    def packed(self, copter: Copter) -> Samples:
        return copter.packed(filter_hz=self.filter_hz, dt_s=self.step_s)

    def fly(self, run: Run) -> Samples:
        packed = vertical.packed(self.parameters, self.step_s, differentiates=self.differentiates)
        state, flown = np.empty(vertical.STATE_SIZE), np.empty((len(run.reference), len(FLOWN)))
        vertical.start_hover(state, packed, *run.start)
        body = start_body(*run.start, run.copter)
        vertical.fly(state, body, packed, run.copter, run.reference, run.disturbances, flown)
        return flown

    def transition(self, copter: Copter, *, late_s: float = 0.0) -> Samples:
        """The copter is late by more lag of its motors."""
        late = replace(copter, motor_lag_s=copter.motor_lag_s + late_s)
        p = vertical.packed(self.parameters, self.step_s, differentiates=self.differentiates)
        dynamic = [*_DYNAMIC, vertical.V_T] if self.differentiates else _DYNAMIC
        step = partial(_after_step, p, self.packed(late), dynamic)
        return transition_of(step, len(dynamic), _NUDGE)


def _after_step(p: vertical.Packed, copter: Samples, dynamic: list[int], nudge: Samples) -> Samples:
    hover = float(copter[HOVER_THROTTLE])
    state = np.empty(vertical.STATE_SIZE)
    vertical.start_hover(state, p, hover, 0.0, 0.0, 0.0)
    state[vertical.RESET] = 0.0
    state[vertical.ACCELERATION_SUM] = 1000.0 * (hover - p[vertical.HOVER])
    state[dynamic] += nudge[: len(dynamic)]
    body = start_body(hover, 0.0, 0.0, 0.0, copter) + nudge[len(dynamic) :]
    vertical.step(state, body, p, copter, np.zeros(len(REFERENCE)), np.zeros(len(DISTURBANCES)))
    return np.concatenate([state[dynamic], body])


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
        older = dict(in_older_names(*each) for each in parameters.items())
        return {name: value for name, value in older.items() if name in LOOP_NAMES}

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
    given = dict(in_older_names(*each) for each in parameters.items())
    require_within(
        given,
        {
            **dict.fromkeys(DEFAULTS, PLAUSIBLE),
            LOOP_RATE: LOOP_RATES_HZ,
            ACCELEROMETER_FILTER: (0.0, LOOP_RATES_HZ[1]),
        },
    )
    step_s = 1.0 / given.get(LOOP_RATE, LOOP_RATE_HZ)
    return ArduPilotLoop(
        parameters=parameters_from(given),
        filter_hz=given.get(ACCELEROMETER_FILTER, ACCELEROMETER_FILTER_HZ),
        step_s=step_s,
        row_s=whole_steps(step_s),
    )


def shaped_reference(loop: ArduPilotLoop, set_points: SetPoints, steps_s: Samples) -> Samples:
    """Its reference at the times of its steps, shape (m, 4) as `REFERENCE`, from rest at the set point before
    the first of them."""
    references = np.full((len(steps_s), len(REFERENCE)), loop.assumed_hover_throttle)
    targets = set_points.at(steps_s)
    vertical.shaped(vertical.packed(loop.parameters, loop.step_s), targets[0], targets, references)
    return references


def read_ardupilot(loop: ArduPilotLoop, trajectory: Trajectory, steps: FlownSteps) -> LoggedFlight:
    """The flight of a trajectory with these channels, from 2 s before the first step to the end.

    Raises TrajectoryError if a channel is missing or too sparse, and if the reference is not the one that the loop
    shapes.
    """
    require_channels(trajectory, steps)
    rows_s, steps_s = steps.rows_s(whole_steps(loop.step_s)), steps.steps_s(loop.step_s)
    reference = shaped_reference(loop, _on_time(loop, trajectory, steps), steps_s)
    z_d, v_d, a_d = (np.interp(rows_s, steps_s, reference[:, column]) for column in range(3))
    demanded = np.interp(steps_s, trajectory.time_s, trajectory["throttle"])
    gain = low_pass_gain(vertical.THROTTLE_FILTER_HZ, loop.step_s)
    sent = filtered(demanded, low_pass(gain))
    scored = (trajectory.time_s >= steps.begin_s) & (trajectory.time_s <= steps.end_s)
    moved = trajectory["throttle"] - np.interp(trajectory.time_s, steps_s, sent)
    return LoggedFlight(
        loop=loop,
        segments=[
            segment_of(trajectory, rows_s, (z_d, v_d, a_d), steps_s, sent, np.full(len(rows_s), np.nan)),
        ],
        activity=float(np.std(moved[scored])),
    )


def _on_time(loop: ArduPilotLoop, trajectory: Trajectory, steps: FlownSteps) -> SetPoints:
    """The set points at the times at which the recorded reference shows them, found one after the other."""
    found, misfit_m = steps.set_points, 0.0
    for place, end_s in enumerate((*found.times_s[2:], steps.end_s), start=1):
        time_s = found.times_s[place]
        misfit = partial(_misfit, loop, trajectory, steps, found, place, (time_s, end_s))
        for lateness_s in _LATENESS_S:
            time_s = min((time_s + lateness_s).tolist(), key=misfit)
        found, misfit_m = _with_time(found, place, time_s), max(misfit_m, misfit(time_s))
    if misfit_m > _LARGEST_MISFIT_M:
        numbers = {"misfit_m": misfit_m}
        raise unanswered(Reason(code=ReasonCode.REFERENCE_NOT_SHAPED, field="reference_m", numbers=numbers))
    return found


def _with_time(set_points: SetPoints, place: int, time_s: float) -> SetPoints:
    times_s = set_points.times_s
    return replace(set_points, times_s=(*times_s[:place], time_s, *times_s[place + 1 :]))


def _misfit(
    loop: ArduPilotLoop,
    trajectory: Trajectory,
    steps: FlownSteps,
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
