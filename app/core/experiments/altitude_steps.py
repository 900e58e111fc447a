"""Steps of the altitude set point in flight, under Paparazzi's vertical loop, which a margin takes as linear about
hover, on the model of `app.core.models.vertical`."""

import math
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from app.core.analysis.loop import MarginTexts
from app.core.control.vertical_guidance import FULL_THRUST, POSITION_BITS, RATE_HZ, STEP_S
from app.core.experiments.base import Check, Envelope, Matrix, ParameterDistribution, Scatter
from app.core.experiments.copter_steps import COPTERS, check_margin
from app.core.experiments.step_sequence import REFERENCE, StepSequence, StepsManoeuvre, step_options
from app.core.experiments.vertical_loop import VerticalLoop, counts
from app.core.models.copter import filtered, motor_filter
from app.core.models.vertical import (
    ALTITUDE,
    CHANNELS,
    COLUMNS,
    DRAG_1_S,
    ENTERED,
    GRAVITY_M_S2,
    HOVER_THROTTLE,
    MEASUREMENT_DELAY_S,
    MOTOR_LAG_S,
    QUADRATIC_SHARE,
    START_LATENCY_S,
    commanded,
    fly_recorded,
    force_at_hover,
    observe,
)
from app.core.models.vertical_batch import reference_altitude
from app.core.policy import Vector
from app.core.records.trajectory import Samples, Trajectory

_COUNTS: Final = np.array([2.0, 2.0, 8.0])
"""Thrust counts per m of altitude error, per m·s of its integral, and per m/s of the climb rate error, for gains kp,
ki, kd of 1: what the fractional bits and the shifts of the loop leave."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearGuidance:
    """A `LinearLoop` with the gains kp, ki, kd, in counts, shape (3,); vehicles are model vectors, shape (8,)."""

    gains: Vector

    texts = MarginTexts(fast_gains="gains", lateness="delay")
    step_s = STEP_S

    def with_fast_gains(self, factor: float) -> Self:
        """All feedback passes through all three gains."""
        return type(self)(factor * self.gains)

    def transition(self, model: Vector, /, *, late_s: float = 0.0) -> Samples:
        """Of integral, altitude, climb rate, thrust, and dead time by its second-order Padé approximation, in which the
        loop's own step is included."""
        from scipy.linalg import expm

        hover, share, lag_s = model[HOVER_THROTTLE], model[QUADRATIC_SHARE], max(model[MOTOR_LAG_S], STEP_S)
        lift_m_s2 = GRAVITY_M_S2 * (1.0 - share + 2.0 * share * hover) / force_at_hover(hover, share)
        dead_s = model[MEASUREMENT_DELAY_S] + late_s + STEP_S
        proportional, integral, damping = -self.gains * _COUNTS / FULL_THRUST
        command = np.array([integral, proportional, damping, 0.0, 0.0, 0.0])
        rates = np.zeros((6, 6))
        rates[0, 1] = rates[1, 2] = rates[4, 5] = 1.0
        rates[2, [2, 3]] = -model[DRAG_1_S], lift_m_s2
        rates[3] = command / lag_s
        rates[3, [3, 5]] = -1.0 / lag_s, -12.0 / dead_s / lag_s
        rates[5] = command
        rates[5, [4, 5]] = -12.0 / dead_s**2, -6.0 / dead_s
        return np.asarray(expm(rates * STEP_S))


CLIMB_S: Final = 10.0
"""Time from the command to the first step: the reference needs 4 s for the climb."""

_SCATTER_M: Final = 0.005
_THRUST: Final = CHANNELS.index("thrust")
_SLOW_S: Final = 1.0 / (2.0 * math.pi * 2.0)
_SEQUENCE: Final = StepSequence(climb_s=CLIMB_S)


class AltitudeSteps(StepsManoeuvre, VerticalLoop):
    """Altitude steps whose reference depends on the set points alone, and is at rest before the first step."""

    name = "altitude-steps"
    title = "Altitude steps"
    options = step_options(largest_step_m=1.0)
    scored_from_s = CLIMB_S
    scatter = Scatter(_SCATTER_M, degrees_of_freedom=1.0, measured=False)
    """Between that of the twin with the default gains, 19 mm, and with tuned ones, 0.5 mm: no real vehicle has flown it
    yet."""
    held_s = 20.0

    def __init__(self, *, sequence: StepSequence = _SEQUENCE) -> None:
        super().__init__(sequence.set_points, sequence.ends_s)
        self.sequence = sequence
        self.measure = str(sequence)

    def with_sequence(self, sequence: StepSequence) -> Self:
        """Another sequence on the nominal model."""
        return type(self)(sequence=sequence)

    def least_model_error(self, base: Trajectory) -> float:
        """The loop rounds the altitude to 1/256 m, and the time at which a step took effect is known to a row of the
        record, by which the reference is early or late; both are uniformly distributed."""
        scored = (base.time_s >= self.scored_from_s) & (base.time_s <= self.window_s)
        row_m = np.abs(np.diff(base[REFERENCE][scored])).mean()
        return math.hypot((1 / (1 << POSITION_BITS)) / math.sqrt(12.0), float(row_m) / math.sqrt(3.0))

    def disturbances(self, trajectory: Trajectory, gains: Vector, model: Vector) -> Matrix:
        """As of all flights under this loop; a thrust command that a link does not record is what the replica commands
        for the recorded altitude, climb rate and set points."""
        grid_s, time_s = self.grid_s, trajectory.time_s
        altitude, climb = (np.interp(grid_s, time_s, trajectory[name]) for name in ("altitude_m", "climb_rate_m_s"))
        if "thrust" in trajectory.channels:
            thrust = np.interp(grid_s, time_s, trajectory["thrust"])
        else:
            rows = np.maximum(np.searchsorted(time_s, grid_s, side="right") - 1, 0)
            targets = np.rint(trajectory["set_point_m"][rows] * (1 << POSITION_BITS)).astype(np.int64)
            entered_step = round(float(model[START_LATENCY_S]) * RATE_HZ)
            thrust = commanded(counts(gains), targets, altitude, climb, entered_step)
        return observe(altitude, climb, thrust, self._models(model, 1)[0])

    def flown(self, gains: Vector, models: Matrix, own: Vector, disturbances: Matrix) -> tuple[float, float]:
        """Mean error, m, of models, (k, m), to which is added what the disturbances cause on their `own` model, (m,),
        and the throttle activity there, share of full: the standard deviation of the commanded thrust about its own
        2 Hz low-pass, over the windows of the steps."""
        calm = disturbances * (np.arange(COLUMNS) == ENTERED)
        disturbed, still = (fly_recorded(counts(gains), own, self.set_points, each) for each in (disturbances, calm))
        outputs = self.outputs(np.tile(gains, (len(models), 1)), models) + disturbed[ALTITUDE] - still[ALTITUDE]
        fast = disturbed[_THRUST] - filtered(disturbed[_THRUST], motor_filter(_SLOW_S, STEP_S))
        scored = self.grid_s >= self.scored_from_s
        return float(np.abs(outputs - self.followed_m)[:, scored].mean()), float(fast[scored].std())

    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:
        """As of all flights under this loop, and the margin from ringing."""
        return (
            *super().hazards(gains, spread, envelope),
            check_margin(LinearGuidance(gains), list(spread.sample(self, COPTERS))),
        )

    @property
    def followed_m(self) -> Samples:
        """The loop's reference in a model run."""
        return reference_altitude(self.set_points, self._samples)

    @property
    def reference(self) -> Samples:
        """The same: a flight may be late in following it."""
        return self.followed_m
