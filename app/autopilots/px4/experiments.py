"""PX4's altitude loop as an analysis takes it, and experiments with gains of its own controllers. Altitude steps are
flown in offboard mode and scored against the set point. The ranges of the gains are those that may be written to such a
vehicle at all: a campaign narrows them to suit its vehicle.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.copter_loop import CopterLoop
from app.autopilots.px4.parameter_file import PARAMETER_FILE
from app.autopilots.px4.replica import vertical
from app.autopilots.px4.replica.hover_range import (
    HOVER_RANGE,
    HOVER_RANGE_NAME,
    HOVER_THRUSTS,
    hover_deviation,
    hover_limits,
)
from app.autopilots.px4.replica.parameters import (
    DEFAULTS,
    LOOP_NAMES,
    THRUST_DEFAULTS,
    Parameters,
    estimator_step_s,
    in_accelerations,
    in_thrusts,
    low_pass_gain,
    parameters_from,
    step_parameters,
)
from app.core.analysis.hover import found_hover
from app.core.analysis.loop import GainSpace, LoggedFlight, LoopTexts, Run, mean_over, transition_of
from app.core.analysis.recorded_flight import FlownSteps, require_channels, segment_of, whole_steps
from app.core.analysis.segment import LEAD_S, Segment, Steps, interpolated
from app.core.control.parameter_checks import PLAUSIBLE, require_within
from app.core.experiments.base import Experiment, Scatter
from app.core.experiments.copter_steps import LARGEST_STEP_M, CopterSteps, copter_parameters
from app.core.experiments.step_sequence import LARGEST_PUSH_M_S2, step_options
from app.core.experiments.takeoff import CopterTakeoff, copter_gain
from app.core.models.copter import (
    DISTURBANCES,
    FLOWN,
    HOVER_THROTTLE,
    REFERENCE,
    Copter,
    Filter,
    advance,
    start_body,
)
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
_DYNAMIC: Final = [
    vertical.THRUST,
    vertical.DERIVATIVE,
    vertical.VELOCITY,
    vertical.INTEGRAL,
    vertical.ACCELERATION_TARGET,
]
"""What the loop remembers from one step to the next, on a reference at rest."""

_NUDGE: Final = 2e-3
"""Large, because the loop has single precision, and between its limits it is linear."""

SLOW_HZ: Final = 2.0
"""Cut-off of the low-pass about which throttle activity is counted."""

_USUAL: Final = Copter(hover_throttle=0.5, thrust_slope=1.25, motor_lag_s=0.05, drag_1_s=0.3)
_THROTTLE, _SLOW = FLOWN.index("throttle"), FLOWN.index("throttle_slow")
_AT_LIMIT: Final = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Px4Loop(CopterLoop):
    """The loop (`AltitudeLoop`), with the limits of its mode.

    The acceleration in the log is the change of the climb rate over `row_s`, a whole number of steps. The estimated
    hover throttle is within `hover_deviation` of the parameter. `vehicle` is the number of the vehicle in MAVLink. The
    gains are those until release 1.10 of a vehicle that hovers with `thrust_gains_at`, if that is given: the firmware
    then estimates no hover throttle.
    """

    parameters: Parameters
    row_s: float
    descent_m_s: float
    hover_deviation: float = HOVER_RANGE
    vehicle: int = 1
    thrust_gains_at: float | None = None

    texts = LoopTexts(
        autopilot="PX4",
        prefix="MPC_",
        hover_parameter="MPC_THR_HOVER",
        hover_range=HOVER_THRUSTS,
        hover_use="PX4 takes off with the parameter, whatever it finds in flight",
        fast_gains="P, I and D of the velocity controller",
        lateness="dead time",
        what_to_fly=(
            "Fly at a height of 3 m or more in a mode that follows an altitude (Hold with a changed altitude, Mission, "
            "Offboard): hover for 5 s, climb 2 m, hover for 5 s, descend 2 m, hover for 5 s, twice; with bit 0 of "
            "SDLOG_PROFILE set, its default. In a takeoff the ramp decides, not the gains."
        ),
        lags="motors, filters of the velocity (MPC_VEL_LP, MPC_VELD_LP)",
        parameter_suffix=PARAMETER_FILE.suffix,
        hover_deviation=HOVER_RANGE_NAME,
    )
    space = GainSpace(
        bounds=MappingProxyType({gain.name: (gain.lower, gain.upper) for gain in GAINS}),
        gentle=MappingProxyType(
            {"MPC_Z_P": 0.5, "MPC_Z_VEL_P_ACC": 2.0, "MPC_Z_VEL_I_ACC": 0.5, "MPC_Z_VEL_D_ACC": 0.0}
        ),
        zeros=MappingProxyType({"MPC_Z_VEL_D_ACC": 0.25}),
    )
    fast = ("MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC", "MPC_Z_VEL_D_ACC")
    compared = ((1.5, 8.0, 3.0, 0.0), (1.5, 6.0, 3.0, 0.3))
    usual_slope = (1.25, 0.35)
    slope_error = 0.06
    target_tolerance_m_s = 0.1

    @property
    def firmware_parameters(self) -> dict[str, float]:
        return self.parameters.named | {HOVER_RANGE_NAME: self.hover_deviation} | step_parameters(self.step_s)

    @property
    def defaults(self) -> Mapping[str, float]:
        return in_accelerations(THRUST_DEFAULTS, self.thrust_gains_at) if self.thrust_gains_at else DEFAULTS

    def named(self, gains: Mapping[str, float]) -> dict[str, float]:
        return in_thrusts(gains, self.thrust_gains_at) if self.thrust_gains_at else dict(gains)

    @property
    def hover_limits(self) -> tuple[float, float] | None:
        return None if self.thrust_gains_at else hover_limits(self.parameters.hover_thrust, self.hover_deviation)

    @property
    def throttle_limits(self) -> tuple[float, float]:
        return self.parameters.thrust_min + _AT_LIMIT, self.parameters.thrust_max - _AT_LIMIT

    @property
    def accelerometer(self) -> Filter:
        return mean_over(self.row_s, self.step_s)

    @property
    def sensor(self) -> Filter:
        """The same: the loop controls no measured acceleration."""
        return self.accelerometer

    def parameter_lines(self, flown: Mapping[str, float], proposed: Mapping[str, float]) -> list[str]:
        return PARAMETER_FILE.changes(flown, proposed, self.vehicle)

    def climb_rate_targets(self, segment: Segment) -> Samples:
        p = self.parameters
        wanted = segment.v_d_m_s + p.position_p_1_s * (segment.z_d_m - segment.z_m)
        return np.clip(wanted, -self.descent_m_s, p.climb_m_s)

    def excitation(self, segment: Segment, throttle: float) -> tuple[Samples, Samples]:
        """What a usual vehicle does along the reference in still air: a step of the reference has no rates."""
        usual = replace(_USUAL, hover_throttle=throttle)
        steps = interpolated(segment, self.step_s)
        reference = steps.reference.copy()
        reference[:, REFERENCE.index("assumed_hover")] = throttle
        run = Run(
            copter=self.packed(usual),
            reference=reference,
            disturbances=np.zeros((len(reference), len(DISTURBANCES))),
            start=(throttle, float(reference[0, 0]), float(reference[0, 1]), 0.0),
        )
        v_m_s = np.interp(segment.time_s, steps.time_s, self._flown(run)[:, FLOWN.index("v_m_s")])
        rates = np.diff(v_m_s) / np.diff(segment.time_s)
        return v_m_s, np.append(rates[0], rates)

    def start(self, steps: Steps) -> tuple[float, float]:
        return float(steps.v_m_s[0]), float(steps.reference[0, 2])

    def packed(self, copter: Copter) -> Samples:
        return copter.packed(filter_hz=0.0, dt_s=self.step_s)

    def fly(self, run: Run) -> Samples:
        """Activity is counted about what the reference alone commands, too: its part of the throttle is fast, and as
        large as the gains are."""
        still = self._flown(replace(run, disturbances=np.zeros_like(run.disturbances)))
        flown = self._flown(run)
        flown[:, _SLOW] += still[:, _THROTTLE] - still[:, _SLOW]
        return flown

    def _flown(self, run: Run) -> Samples:
        packed, inputs = vertical.packed(self.parameters, self.step_s), self._inputs()
        state, outputs = (
            np.empty(vertical.STATE_SIZE, dtype=np.float32),
            np.empty((1, len(vertical.OUTPUTS)), dtype=np.float32),
        )
        throttle, _, v_m_s, _ = run.start
        vertical.start_hover(state, packed, float(run.reference[0, 3]), throttle, -v_m_s)
        body, flown = start_body(*run.start, run.copter), np.empty((len(run.reference), len(FLOWN)))
        slow_gain = low_pass_gain(SLOW_HZ, self.step_s)
        vertical.fly(
            state, body, packed, run.copter, self.step_s, slow_gain, inputs, outputs, run.reference, run.disturbances,
            flown,
        )  # fmt: skip
        return flown

    def transition(self, copter: Copter, *, late_s: float = 0.0) -> Samples:
        """With the hover throttle of the vehicle as PX4 estimates it in flight. The copter is late by dead time, in
        whole steps: with more lag alone, a loop without a filter of its throttle hardly ever rings."""
        packed, p = self.packed(copter), vertical.packed(self.parameters, self.step_s)
        hover = float(packed[HOVER_THROTTLE])
        estimate = self.thrust_gains_at or found_hover(self, hover)
        reference, still = np.array([[0.0, 0.0, 0.0, estimate]]), np.zeros((1, len(DISTURBANCES)))
        inputs, outputs = self._inputs(), np.empty((1, len(vertical.OUTPUTS)), dtype=np.float32)

        def after_step(nudge: Samples) -> Samples:
            state, flown = np.empty(vertical.STATE_SIZE, dtype=np.float32), np.empty((1, len(FLOWN)))
            vertical.start_hover(state, p, estimate, hover, 0.0)
            state[_DYNAMIC] += nudge[: len(_DYNAMIC)].astype(np.float32)
            body = start_body(hover, 0.0, 0.0, 0.0, packed) + nudge[len(_DYNAMIC) :]
            vertical.fly(state, body, p, packed, self.step_s, 1.0, inputs, outputs, reference, still, flown)
            return np.concatenate([state[_DYNAMIC].astype(np.float64), body])

        def body_after_step(nudge: Samples) -> Samples:
            body = start_body(hover, 0.0, 0.0, 0.0, packed) + nudge[1:]
            advance(body, packed, self.step_s, hover + float(nudge[0]), 0.0, 0.0)
            return np.append(0.0, body)

        together = transition_of(after_step, len(_DYNAMIC), _NUDGE)
        steps = round(late_s / self.step_s)
        return _late(together, transition_of(body_after_step, 1, _NUDGE), steps) if steps else together

    def _inputs(self) -> NDArray[np.float32]:
        """Inputs of the loop in flight, shape (1, 15), without estimates and set-points."""
        inputs = np.zeros((1, len(vertical.INPUTS)), dtype=np.float32)
        given = {
            "dt_s": self.step_s,
            "set_new": 1.0,
            "armed": 1.0,
            "limit_up_m_s": self.parameters.climb_m_s,
            "limit_down_m_s": self.descent_m_s,
        }
        for name, value in given.items():
            inputs[0, vertical.INPUTS.index(name)] = value
        return inputs


def _late(together: Samples, body: Samples, steps: int) -> Samples:
    """The transition of loop and body, shape (k, k), with a throttle that arrives `steps` later; `body` is that of
    the throttle and the body alone. The throttles on their way are appended to the state."""
    size, first = len(together), len(_DYNAMIC)
    late = np.zeros((size + steps, size + steps))
    late[:first, :size] = together[:first]
    late[first:size, first:size] = body[1:, 1:]
    late[first:size, -1] = body[1:, 0]
    late[size, :size] = together[_DYNAMIC.index(vertical.THRUST)]
    late[size + 1 :, size:-1] = np.eye(steps - 1)
    return late


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
        return {name: value for name, value in parameters.items() if name in LOOP_NAMES}

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
    require_within(parameters, dict.fromkeys(DEFAULTS, PLAUSIBLE))
    given, step_s = parameters_from(parameters), estimator_step_s(parameters)
    return Px4Loop(
        parameters=given,
        step_s=step_s,
        row_s=whole_steps(step_s),
        descent_m_s=given.descent_m_s,
        hover_deviation=hover_deviation(parameters),
    )


def read_px4(loop: Px4Loop, trajectory: Trajectory, steps: FlownSteps) -> LoggedFlight:
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
