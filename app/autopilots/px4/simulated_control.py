"""PX4's altitude control of a simulated copter: the replica of its vertical loop around the airframe.

The loop runs in every second tick of the drone, at 128 Hz, close to the 125 Hz of PX4's own simulation, from arming on.
Auto modes follow PX4's jerk-limited trajectory, renewed in every run instead of at 50 Hz; OFFBOARD passes the streamed
set points to the loop as they are.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from app.autopilots.px4 import simulated_hover as px4_hover
from app.autopilots.px4.replica import vertical as loop
from app.autopilots.px4.replica.parameters import parameters_from
from app.autopilots.px4.simulated_trajectory import Limits, Trajectory
from app.autopilots.simulated.body import TICK_S, Body
from app.autopilots.simulated.copter_control import AltitudeController, Phase, SetPoint

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
        self._estimate = self._hover.start()
        self._estimates = False
        self._compile()

    def _compile(self) -> None:
        """Compile now what is compiled on first use: in flight the drone would be silent meanwhile."""
        state = self._state.copy()
        loop.start(state, self._packed)
        loop.rollout(state, self._packed, self.inputs, self.outputs.copy())
        px4_hover.update(self._hover.start(), self._hover_packed, 0.0, self.demand, 0.0, LOOP_S)

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
        self._hover = px4_hover.HoverSettings(
            hover_thrust=positive["MPC_THR_HOVER"],
            initial_error=values["HTE_HT_ERR_INIT"],
            noise_1_s=values["HTE_HT_NOISE"],
            gate=positive["HTE_ACC_GATE"],
            range=values["HTE_THR_RANGE"],
            fast_m_s=values["HTE_VZ_THR"],
        )
        self._hover_packed = self._hover.packed()

    # ------------------------------------------------------------ commands

    def arm(self) -> None:
        super().arm()
        loop.start(self._state, self._packed)
        self._estimate = self._hover.start()

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
        return px4_hover.update(self._estimate, self._hover_packed, acceleration_m_s2, self.demand, climb_m_s, LOOP_S)

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
