"""PX4's altitude control of a simulated copter: the replica of its vertical loop around the airframe.

The loop runs in every second tick of the drone, at 128 Hz, close to the 125 Hz of PX4's own simulation, from arming on.
Auto modes follow PX4's jerk-limited trajectory, renewed in every run instead of at 50 Hz; OFFBOARD passes the streamed
set points to the loop as they are.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from app.autopilots.px4.replica import vertical as loop
from app.autopilots.px4.replica.hover_range import hover_limits
from app.autopilots.px4.replica.parameters import parameters_from
from app.autopilots.px4.simulated_trajectory import Limits, Trajectory
from app.autopilots.simulated.body import TICK_S, Body
from app.autopilots.simulated.copter_control import AltitudeController, Phase, SetPoint
from app.core.kernels import kernel
from app.core.models.copter import GRAVITY_M_S2
from app.core.records.trajectory import Samples

LOOP_TICKS: Final = 2
LOOP_S: Final = LOOP_TICKS * TICK_S
_ARRIVED_WITHIN_M: Final = 0.8
"""NAV_MC_ALT_RAD: a takeoff has arrived this far from its height."""
_WAITING_M_S: Final = -0.7
"""Climb rate of the trajectory until the ramp begins."""
_GROUND_CONTACT_S: Final = 0.35
_ESTIMATES_ABOVE_M: Final = 1.0
_SET_POINT_FRESH_S: Final = 1.0
_AUTO_MARGIN: Final = 1.2
"""Of the limits of the controller over those of the trajectory in auto modes."""
_LEAST: Final = 0.01
"""Limits of the trajectory must be positive; smaller parameters act as this."""

_HOVER_THRUST, _VARIANCE, _NOISE_VARIANCE, _MEAN_INNOVATION, _MEAN_RATIO, _STEADY_S = range(6)
"""Indices in the state array of the estimator."""
_FIRST_NOISE_VARIANCE: Final = 5.0
_NOISE_S: Final = 2.0
_INNOVATION_S: Final = 1.0
_BIASED_ABOVE: Final = 0.2
_FORGETTING: Final = 1000.0
_VALID_BELOW: Final = 0.001
_VALID_AFTER_S: Final = 2.0


def estimator_settings(values: Mapping[str, float]) -> Samples:
    """Return the constants of `estimate_hover`, shape (5,), from parameters by the firmware's names."""
    low, highest = hover_limits(values["MPC_THR_HOVER"], values["HTE_THR_RANGE"])
    lowest = max(low, 0.05)
    return np.array([values["HTE_HT_NOISE"], values["HTE_ACC_GATE"], lowest, highest, values["HTE_VZ_THR"]])


def started_estimate(values: Mapping[str, float]) -> Samples:
    """Return the state of the estimator while disarmed, shape (6,): MPC_THR_HOVER."""
    return np.array([values["MPC_THR_HOVER"], values["HTE_HT_ERR_INIT"] ** 2, _FIRST_NOISE_VARIANCE, 0.0, 0.0, 0.0])


@kernel
def estimate_hover(state: Samples, settings: Samples, a: float, thrust: float, climb: float, dt: float) -> float:
    """Advance PX4's estimator of the hover thrust, a Kalman filter of one state, by `dt`, s, with the acceleration `a`,
    m/s² up, under `thrust`, a share of full, at the climb rate `climb`, m/s; return the estimate, or NaN until it is
    valid. `settings` are those of `estimator_settings`."""
    grown = (settings[0] * dt) ** 2
    hover, variance = state[_HOVER_THRUST], state[_VARIANCE] + grown
    slope = -GRAVITY_M_S2 * thrust / (hover * hover)
    noise = state[_NOISE_VARIANCE] * max(1.0, abs(climb) - settings[4] + 1.0) ** 2
    total = slope * slope * variance + noise
    innovation = a - GRAVITY_M_S2 * (thrust / hover - 1.0)
    ratio = innovation * innovation / (settings[1] * settings[1] * total)
    if ratio < 1.0:
        gain = variance * slope / total
        hover = min(max(hover + gain * innovation, settings[2]), settings[3])
        variance = min(max((1.0 - gain * slope) * variance, 1e-10), 1.0)
        innovation = a - GRAVITY_M_S2 * (thrust / hover - 1.0)
    elif abs(state[_MEAN_RATIO]) > _BIASED_ABOVE:
        variance += _FORGETTING * grown
    state[_HOVER_THRUST], state[_VARIANCE] = hover, variance
    share = dt / (_INNOVATION_S + dt)
    state[_MEAN_RATIO] += share * (math.copysign(min(ratio, 1.0), innovation) - state[_MEAN_RATIO])
    state[_MEAN_INNOVATION] += share * (innovation - state[_MEAN_INNOVATION])
    scatter = (innovation - state[_MEAN_INNOVATION]) ** 2 + slope * slope * variance
    noise_variance = state[_NOISE_VARIANCE] + dt / (_NOISE_S + dt) * (scatter - state[_NOISE_VARIANCE])
    state[_NOISE_VARIANCE] = min(max(noise_variance, 1.0), 400.0)
    was_valid = state[_STEADY_S] >= _VALID_AFTER_S
    is_steady = variance < _VALID_BELOW and (ratio < 1.0 or was_valid)
    state[_STEADY_S] = state[_STEADY_S] + dt if is_steady else 0.0
    estimate: float = hover if state[_STEADY_S] >= _VALID_AFTER_S else math.nan
    return estimate


class Px4Controller(AltitudeController):
    """PX4's loop: takeoff, holding, landing, and streamed set points."""

    def __init__(self, body: Body, values: Mapping[str, float], *, ground_m: float) -> None:
        """`ground_m` is the height of the ground in the local frame, in which the loop has its altitude."""
        super().__init__(body)
        self._ground_m = ground_m
        self._state = np.zeros(loop.STATE_SIZE, dtype=np.float32)
        self.inputs = np.zeros((1, len(loop.INPUTS)), dtype=np.float32)
        """Last inputs of the loop, shape (1, 15) as `INPUTS`."""
        self.outputs = np.zeros((1, len(loop.OUTPUTS)), dtype=np.float32)
        """Last outputs of the loop, shape (1, 6) as `OUTPUTS`."""
        self._trajectory = Trajectory()
        self._goal_m = 0.0
        self._follows = False
        self._streamed: SetPoint | None = None
        self._streamed_age_s = math.inf
        self._in_force = SetPoint()
        self._tick = 0
        self._climb_m_s = 0.0
        self.tune(values)
        self._estimate = self._disarmed_estimate.copy()
        self._estimates = False
        self._compile()

    def _compile(self) -> None:
        """Compile now what is compiled on first use: in flight the drone would be silent meanwhile."""
        state = self._state.copy()
        loop.start(state, self._packed)
        loop.rollout(state, self._packed, self.inputs, self.outputs.copy())
        estimate_hover(self._estimate.copy(), self._estimator, 0.0, self.demand, 0.0, LOOP_S)

    def tune(self, values: Mapping[str, float]) -> None:
        """Use these parameters, by the firmware's names, from the next run on. Raises InputError if the loop is not
        defined for them."""
        self._packed = loop.packed(parameters_from(values), LOOP_S)
        positive = {name: max(value, _LEAST) for name, value in values.items()}
        jerk = positive["MPC_JERK_AUTO"]
        self._up = Limits(positive["MPC_Z_V_AUTO_UP"], positive["MPC_ACC_UP_MAX"], jerk)
        self._down = Limits(positive["MPC_Z_V_AUTO_DN"], positive["MPC_ACC_DOWN_MAX"], jerk)
        speed, gentle = positive["MPC_TKO_SPEED"], positive["MPC_TKO_SPEED"] / positive["MPC_TKO_RAMP_T"]
        self._takeoff = Limits(speed, min(self._up.acceleration_m_s2, gentle), jerk)
        self._land_m_s = positive["MPC_LAND_SPEED"]
        self._fast_up_m_s, self._fast_down_m_s = values["MPC_Z_VEL_MAX_UP"], values["MPC_Z_VEL_MAX_DN"]
        hover = {**values, "MPC_THR_HOVER": positive["MPC_THR_HOVER"], "HTE_ACC_GATE": positive["HTE_ACC_GATE"]}
        self._estimator = estimator_settings(hover)
        self._disarmed_estimate = started_estimate(hover)

    # ------------------------------------------------------------ commands

    def arm(self) -> None:
        super().arm()
        loop.start(self._state, self._packed)
        self._estimate = self._disarmed_estimate.copy()

    def take_off(self, height_m: float) -> None:
        self._goal_m, self._follows = height_m, False
        self.phase = Phase.CLIMBING

    def hold(self) -> None:
        if not self.flies:
            self._follows = False
        elif self._body.stands and self._state[loop.TAKEOFF] < loop.FLIGHT:
            self._follows, self.phase = False, Phase.IDLE
        else:
            self._start_trajectory()
            climb_m_s = self._trajectory.climb_m_s
            limits = self._up if climb_m_s > 0.0 else self._down
            self._goal_m = self._trajectory.altitude_m + limits.stopping_distance(climb_m_s)
            self.phase = Phase.HOLDING

    def begin_landing(self) -> None:
        self._start_trajectory()

    def begin_following(self) -> None:
        """Follow the streamed set points from now on; on the ground it takes off if they ask for it."""
        self._follows = True
        if self.flies:
            self.phase = Phase.HOLDING

    def stream(self, set_point: SetPoint) -> None:
        """Store a streamed set point, for when it follows them."""
        self._streamed, self._streamed_age_s = set_point, 0.0

    # ------------------------------------------------------------ the loop

    def run(self) -> float:
        self._tick += 1
        self._streamed_age_s += TICK_S
        if self._armed_s is None:
            return 0.0
        if self._tick % LOOP_TICKS == 0:
            self._run_loop()
        if self.phase is Phase.LANDING and self._body.stands and self._state[loop.TAKEOFF] < loop.FLIGHT:
            return 0.0
        return self.demand

    def _run_loop(self) -> None:
        body = self._body
        is_new = self._update_set_point()
        given, z = self._in_force, -(body.altitude_m + self._ground_m)
        self.inputs[0] = (
            LOOP_S,
            z,
            -body.climb_rate_m_s,
            -body.climb_rate_m_s,
            -(given.altitude_m + self._ground_m),
            -given.climb_m_s,
            -given.acceleration_m_s2,
            is_new,
            self._estimated_hover(),
            True,
            not self.flies,
            self.phase is Phase.LANDING and self._standing_s > _GROUND_CONTACT_S,
            self._wants_takeoff(),
            self._fast_up_m_s if self._follows else max(self._fast_up_m_s, _AUTO_MARGIN * self._up.speed_m_s),
            self._fast_down_m_s if self._follows else max(self._fast_down_m_s, _AUTO_MARGIN * self._down.speed_m_s),
        )
        loop.rollout(self._state, self._packed, self.inputs, self.outputs)
        if self._follows and not self.flies and self._state[loop.TAKEOFF] >= loop.RAMP_UP:
            self.phase = Phase.HOLDING

    def _update_set_point(self) -> bool:
        """Update the set point in force; return whether it is new."""
        if self._follows:
            is_new = self._streamed is not None and self._streamed_age_s <= LOOP_S
            self._in_force = self._streamed or SetPoint()
            return is_new
        trajectory = self._trajectory
        match self.phase:
            case Phase.IDLE:
                self._in_force = SetPoint()
                return False
            case Phase.CLIMBING:
                self._climb()
            case Phase.HOLDING:
                limits = self._up if self._goal_m > trajectory.altitude_m else self._down
                trajectory.step(limits.approach_speed(self._goal_m - trajectory.altitude_m), limits, LOOP_S)
            case Phase.LANDING:
                trajectory.altitude_m = self._body.altitude_m
                trajectory.step(-self._land_m_s, self._down, LOOP_S)
        altitude_m = math.nan if self.phase is Phase.LANDING else trajectory.altitude_m
        self._in_force = SetPoint(altitude_m, trajectory.climb_m_s, trajectory.acceleration_m_s2)
        return True

    def _climb(self) -> None:
        """Advance the trajectory of a takeoff, whose altitude is the measured one."""
        altitude_m, trajectory = self._body.altitude_m, self._trajectory
        if self._state[loop.TAKEOFF] < loop.RAMP_UP:
            trajectory.start(altitude_m, _WAITING_M_S)
            return
        trajectory.altitude_m = altitude_m
        trajectory.step(self._takeoff.approach_speed(self._goal_m - altitude_m), self._takeoff, LOOP_S)
        if abs(self._goal_m - altitude_m) < _ARRIVED_WITHIN_M:
            self.phase = Phase.HOLDING

    def _wants_takeoff(self) -> bool:
        if not self._follows:
            return self.flies
        given = self._in_force
        rises = given.altitude_m > self._body.altitude_m or given.climb_m_s > 0.0 or given.acceleration_m_s2 > 0.0
        return rises and self._streamed_age_s < _SET_POINT_FRESH_S

    def _estimated_hover(self) -> float:
        """Return the estimated hover thrust, or NaN; estimates begin at a height of 1 m, once in flight."""
        climb_m_s, before_m_s = self._body.climb_rate_m_s, self._climb_m_s
        self._climb_m_s = climb_m_s
        is_flying = self._state[loop.TAKEOFF] == loop.FLIGHT
        self._estimates = is_flying and (self._estimates or self._body.altitude_m > _ESTIMATES_ABOVE_M)
        if not self._estimates:
            return math.nan
        acceleration_m_s2 = (climb_m_s - before_m_s) / LOOP_S
        return estimate_hover(self._estimate, self._estimator, acceleration_m_s2, self.demand, climb_m_s, LOOP_S)

    def _start_trajectory(self) -> None:
        """Begin the trajectory of an auto mode; a running one goes on."""
        if self._follows:
            self._trajectory.start(self._body.altitude_m, self._body.climb_rate_m_s)
        self._follows = False

    # ------------------------------------------------------------ telemetry

    @property
    def set_point(self) -> SetPoint:
        return self._in_force

    @property
    def error_m(self) -> float:
        return float(self.inputs[0, 1] - self._state[loop.SET_Z])

    @property
    def demand(self) -> float:
        return float(self._state[loop.THRUST])
