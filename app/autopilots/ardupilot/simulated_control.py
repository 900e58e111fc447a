"""ArduCopter's altitude control of a simulated copter: the replica of its vertical loop around the airframe.

The loop runs once in each tick of the drone, so its rate is 256 Hz instead of the usual 400 Hz, and the parameter
SCHED_LOOP_RATE says so: the interval enters the loop's filters and integrals as the firmware's measured loop time does,
and running more loops than there are measurements would only repeat the last ones. The landing is the loop's own shaper
towards a target far below, with LAND_SPEED as its limit.
"""

from typing import Final

import numpy as np

from app.autopilots.ardupilot.replica import vertical as loop
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.autopilots.ardupilot.replica.shaping import inverse_square_root
from app.autopilots.simulated.body import TICK_S, Body
from app.autopilots.simulated.copter_control import AltitudeController, Phase, SetPoint
from app.core.models.copter import accelerometer_filter

LOOP_HZ: Final = 1.0 / TICK_S
HELD_ON_GROUND_S: Final = 2.0
"""For so long after arming the motors stay off."""
SPOOL_FROM_IDLE_S: Final = 0.17
"""Time from the takeoff command to the ramp, if the motors idle already."""
_ARRIVED_WITHIN_M: Final = 0.05
_FAR_BELOW_M: Final = 10.0
_LEARNING_S: Final = 10.0
_AT_REST_M_S: Final = 1e-6
"""Of the desired climb rate, which the firmware's single precision rounds to 0."""
_LEARNING_BELOW_M_S: Final = 0.6


class Accelerometer:
    """Vertical acceleration, m/s², from the changes of the climb rate, through INS_ACCEL_FILTER."""

    def __init__(self, cutoff_hz: float) -> None:
        self.tune(cutoff_hz)
        self.reset(0.0)

    def tune(self, cutoff_hz: float) -> None:
        numerator, denominator = accelerometer_filter(cutoff_hz, TICK_S)
        self._b0, self._b1, self._b2 = map(float, numerator)
        _, self._a1, self._a2 = map(float, denominator)

    def reset(self, climb_m_s: float) -> None:
        """Begin at this climb rate, unaccelerated."""
        self.value_m_s2: float = 0.0
        self._memory_1 = self._memory_2 = 0.0
        self._climb_m_s = climb_m_s

    def sense(self, climb_m_s: float) -> float:
        """Return the acceleration, one tick after the last call."""
        raw = (climb_m_s - self._climb_m_s) / TICK_S
        self._climb_m_s = climb_m_s
        value = self.value_m_s2 = self._b0 * raw + self._memory_1
        self._memory_1 = self._b1 * raw - self._a1 * value + self._memory_2
        self._memory_2 = self._b2 * raw - self._a2 * value
        return value


class ArduPilotController(AltitudeController):
    """ArduCopter's loop: takeoff, position targets in GUIDED, holding, landing."""

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self._state = np.zeros(loop.STATE_SIZE)
        self.inputs = np.zeros((1, len(loop.INPUTS)))
        """Last inputs of the loop, shape (1, 6) as `INPUTS`."""
        self.outputs = np.zeros((1, len(loop.OUTPUTS)))
        """Last outputs of the loop, shape (1, 8) as `OUTPUTS`."""
        self._followed = np.zeros(1, dtype=np.bool_)
        self._accelerometer = Accelerometer(0.0)
        self._target_m = 0.0
        self._takes_targets = False
        self.tune(Parameters(), accelerometer_hz=0.0, spool_s=0.0, land_m_s=1.0)
        self._compile()

    def _compile(self) -> None:
        """Compile now what is compiled on first use: in flight the drone would be silent meanwhile."""
        state, outputs = self._state.copy(), self.outputs.copy()
        loop.start_takeoff(state, self._packed, 0.0)
        loop.enter_position_mode(state, self._packed, 0.0, 0.0, 0.0)
        loop.rollout(state, self._packed, self.inputs, outputs, self._followed, outputs)
        inverse_square_root(1.0, 1.0, 1.0)

    def tune(self, parameters: Parameters, *, accelerometer_hz: float, spool_s: float, land_m_s: float) -> None:
        """Use these parameters from the next tick on; `spool_s` is MOT_SPOOL_TIME, `land_m_s` positive."""
        self._packed = loop.packed(parameters, TICK_S)
        self._landing = self._packed.copy()
        self._landing[loop.DESCENT] = land_m_s
        self._accelerometer.tune(accelerometer_hz)
        self._spool_s = spool_s

    # ------------------------------------------------------------ commands

    def take_off(self, height_m: float) -> None:
        """Spool up, ramp and climb to this height: the motors stay off until 2 s after arming."""
        since_s = self._armed_s or 0.0
        spool_s = max(HELD_ON_GROUND_S + self._spool_s - since_s, SPOOL_FROM_IDLE_S)
        loop.start_takeoff(self._state, self._packed, spool_s)
        self._accelerometer.reset(self._body.climb_rate_m_s)
        self._target_m, self._takes_targets = height_m, False
        self.phase = Phase.CLIMBING

    def move_to(self, altitude_m: float) -> None:
        """Fly to this altitude, in flight. The first target after another command makes the present altitude the
        desired one, from which the trajectory to the target begins."""
        if not self._is_in_flight:
            return
        if not self._takes_targets:
            self._enter_position_mode()
            self._takes_targets = True
        self._target_m = altitude_m
        self.phase = Phase.HOLDING

    def hold(self) -> None:
        if self._is_in_flight:
            self._enter_position_mode()
            acceleration, jerk = self._packed[loop.ACCELERATION], self._packed[loop.JERK]
            stops_within_m = inverse_square_root(
                self._body.climb_rate_m_s, 0.5 * jerk / acceleration, 0.5 * acceleration
            )
            self._target_m = self._body.altitude_m + stops_within_m
            self.phase = Phase.HOLDING
        else:
            self.phase = Phase.IDLE
        self._takes_targets = False

    def begin_landing(self) -> None:
        self._takes_targets = False

    # ------------------------------------------------------------ the loop

    def run(self) -> float:
        if not self.flies:
            return 0.0
        state, body = self._state, self._body
        packed, target_m = self._packed, self._target_m
        acceleration = self._accelerometer.sense(body.climb_rate_m_s)
        if self.phase is Phase.LANDING:
            if state[loop.PHASE] != loop.FLIGHT:
                return 0.0
            packed, target_m = self._landing, float(state[loop.Z_D]) - _FAR_BELOW_M
        throttle = state[loop.THROTTLE_FILTERED]
        throttle += packed[loop.THROTTLE_GAIN] * (state[loop.THROTTLE] - throttle)
        self.inputs[0] = target_m, body.altitude_m, body.climb_rate_m_s, acceleration, throttle <= 0.0, throttle >= 1.0
        loop.rollout(state, packed, self.inputs, self.outputs, self._followed, self.outputs)
        if self.phase is Phase.CLIMBING and abs(self._target_m - state[loop.Z_D]) < _ARRIVED_WITHIN_M:
            self.phase = Phase.HOLDING
        return float(state[loop.THROTTLE_FILTERED])

    def learned_hover(self) -> float | None:
        """Return the hover throttle, corrected by that of this tick (MOT_HOVER_LEARN), or None unless it hovers."""
        if self.phase is not Phase.HOLDING or abs(self._body.climb_rate_m_s) >= _LEARNING_BELOW_M_S:
            return None
        throttle, hover = float(self._state[loop.THROTTLE_FILTERED]), float(self._packed[loop.HOVER])
        if throttle <= 0.0 or abs(self._state[loop.V_D]) >= _AT_REST_M_S:
            return None
        hover += TICK_S / (TICK_S + _LEARNING_S) * (throttle - hover)
        self._packed[loop.HOVER] = self._landing[loop.HOVER] = hover = min(max(hover, loop.HOVER_MIN), loop.HOVER_MAX)
        return hover

    # ------------------------------------------------------------ telemetry

    @property
    def set_point(self) -> SetPoint:
        return SetPoint(self._target_m)

    @property
    def error_m(self) -> float:
        return float(self._state[loop.POSITION_ERROR]) if self.flies else 0.0

    @property
    def demand(self) -> float:
        return min(max(float(self._state[loop.THROTTLE]), 0.0), 1.0) if self.flies else 0.0

    # ------------------------------------------------------------

    @property
    def _is_in_flight(self) -> bool:
        """Whether the controllers have taken over, after spool-up and ramp."""
        return self.flies and bool(self._state[loop.PHASE] == loop.FLIGHT)

    def _enter_position_mode(self) -> None:
        body = self._body
        loop.enter_position_mode(
            self._state, self._packed, body.altitude_m, body.climb_rate_m_s, self._accelerometer.value_m_s2
        )
