"""What altitude steps under ArduCopter and PX4 share: the sequence, its score, the model of the vehicle, and what the
gate checks on a few copters that the flights allow.

The model is the copter of `app.core.models.copter` under the replica of the autopilot's loop. It starts in hover at the
first height, `LEAD_S` before the first step; until then it is where its reference is. Gains beside those in the
experiment's space, filters and limits are the autopilot's parameters (`under`), by default the firmware's.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Final, Self, TypeVar

import numpy as np

from app.core.analysis.hover import HoverAdvice, advise_hover, found_hover
from app.core.analysis.loop import AltitudeLoop, LinearLoop, LoggedFlight, Run
from app.core.analysis.margin import EXTRA_LAG_S, REQUIRED_MARGIN, RINGING_DAMPING, robust_damping
from app.core.analysis.recorded_flight import FlownSteps
from app.core.errors import InputError, Problem
from app.core.experiments.base import (
    Check,
    Envelope,
    Matrix,
    ModelledExperiment,
    ModelParameter,
    ParameterDistribution,
    SimplexSearch,
)
from app.core.experiments.step_sequence import ALTITUDE, REFERENCE, StepSequence, StepsManoeuvre, step_options
from app.core.formatting import number
from app.core.models.copter import DISTURBANCES, FLOWN, Copter
from app.core.models.set_points import SetPoints
from app.core.policy import Vector
from app.core.records.trajectory import Samples, Trajectory

CLIMB_S: Final = 15.0
"""Time from the command to the first step: ArduCopter's motors are off for 2 s after arming, PX4's thrust rises for 3 s
in a takeoff, and both then settle."""
LARGEST_STEP_M: Final = 2.0

COPTERS: Final = 5
"""Vehicles of a distribution that are checked, and for which gains are searched."""
_KNOWN_TO: Final = 0.03
"""Standard deviation of a hover throttle that flights have shown; the data sheet's is larger."""

_V = TypeVar("_V")

_SEQUENCE: Final = StepSequence(climb_s=CLIMB_S)
_SHOWN: Final = {ALTITUDE: "z_m", "climb_rate_m_s": "v_m_s", "throttle": "throttle"}


def copter_parameters(hover: tuple[float, float], slope: tuple[float, float]) -> tuple[ModelParameter, ...]:
    """The parameters of a copter in the order of `copter_of`: those in hover with their means and standard deviations
    over vehicles."""
    return (
        _parameter("hover_throttle", "Hover throttle", "of full", *hover, 0.05, 0.9),
        _parameter("thrust_slope", "Thrust slope", "", *slope, 0.2, 3.0),
        _parameter("motor_lag_s", "Motor lag", "s", 0.05, 0.05, 0.0, 0.25),
        _parameter("drag_1_s", "Drag", "1/s", 0.3, 0.3, 0.0, 2.0),
    )


def _parameter(name: str, title: str, unit: str, mean: float, sd: float, lower: float, upper: float) -> ModelParameter:
    return ModelParameter(name, title, unit, upper, prior_sd=sd, known_within=sd, nominal=mean, lower=lower)


def copter_of(model: Vector) -> Copter:
    """The copter of model parameters, shape (4,)."""
    hover_throttle, thrust_slope, motor_lag_s, drag_1_s = model.tolist()
    return Copter(hover_throttle=hover_throttle, thrust_slope=thrust_slope, motor_lag_s=motor_lag_s, drag_1_s=drag_1_s)


def vector_of(copter: Copter) -> Vector:
    """The model parameters of a copter, shape (4,)."""
    return np.array([copter.hover_throttle, copter.thrust_slope, copter.motor_lag_s, copter.drag_1_s])


@dataclass(eq=False, kw_only=True)
class CopterSteps(StepsManoeuvre, ModelledExperiment):
    """Altitude steps under an autopilot, with the model of a copter, by default one as in its `data_sheet`. `unfit` are
    the autopilot's parameters with which the replica of its loop does not hold."""

    autopilot: ClassVar[str]
    data_sheet: ClassVar[tuple[ModelParameter, ...]]
    """The parameters of copters under this autopilot in general."""

    options = step_options(largest_step_m=LARGEST_STEP_M)
    grid_hz = 50.0
    scored_from_s = CLIMB_S
    search = SimplexSearch(of_scale=0.5, evaluations=200)
    difference = 0.05

    sequence: StepSequence = _SEQUENCE
    parameters: Mapping[str, float] = field(default_factory=dict)
    model_parameters: tuple[ModelParameter, ...] = ()
    unfit: tuple[Problem, ...] = ()

    def __post_init__(self) -> None:
        self.title = f"{self.curves_title} under {self.autopilot}"
        self.set_points = self.sequence.set_points
        self.window_s = self.sequence.ends_s
        self.measure = f"{self.sequence}, under {self.autopilot}"
        self.model_parameters = self.model_parameters or self.data_sheet

    @abstractmethod
    def loop(self, gains: Vector) -> AltitudeLoop:
        """The loop with these gains, shape (g,), and the autopilot's parameters."""

    @abstractmethod
    def loop_parameters(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Those of an autopilot's parameters on which its loop depends, gains among them."""

    @abstractmethod
    def read(self, trajectory: Trajectory, gains: Vector) -> LoggedFlight:
        """A flight with these gains as an analysis takes it. Raises TrajectoryError if its record does not suffice."""

    @abstractmethod
    def references(self, steps_s: Samples) -> Samples:
        """What the loop is given at the times of its steps, shape (m, 4) as `REFERENCE`; without a hover throttle that
        it assumes."""

    @property
    def steps(self) -> FlownSteps:
        """The scored part of a flight."""
        return FlownSteps(set_points=self.set_points, begin_s=self.scored_from_s, end_s=self.window_s)

    def with_sequence(self, sequence: StepSequence) -> Self:
        """Another sequence of the same copter."""
        return replace(self, sequence=sequence)

    def under(self, parameters: Mapping[str, float]) -> Self:
        """The experiment with these parameters of the autopilot. If the replica of its loop does not hold with one,
        with its own, and `hazards` names that parameter."""
        try:
            return self.exactly_under(parameters)
        except InputError as error:
            return replace(self, unfit=error.problems)

    def exactly_under(self, parameters: Mapping[str, float]) -> Self:
        """The experiment with these parameters of the autopilot, with its own if there are none.

        Raises InputError for one with which the replica of its loop does not hold.
        """
        changed = replace(self, parameters=self.loop_parameters(parameters) or self.parameters, unfit=())
        changed.loop(self.space.default)
        return changed

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        """One run of the model; before the first step, of its reference."""
        steps_s, flown = self._fly(gains, model)
        grid_s, reference = self.grid_s, self.followed_m
        channels = {name: np.interp(grid_s, steps_s, flown[:, FLOWN.index(of)]) for name, of in _SHOWN.items()}
        channels[ALTITUDE] = np.where(grid_s < steps_s[0], reference, channels[ALTITUDE])
        named = channels | {REFERENCE: reference, "set_point_m": self.set_point(grid_s)}
        return Trajectory(grid_s, named, "model", "simulation")

    def outputs(self, gains: Matrix, model: Matrix) -> Matrix:
        """Altitude of many policies, each on its own model or all on one: gains (k, g) → (k, n)."""
        grid_s, reference = self.grid_s, self.followed_m
        altitudes = np.tile(reference, (len(gains), 1))
        for row, (some, copter) in enumerate(zip(gains, np.broadcast_to(model, (len(gains), 4)), strict=True)):
            steps_s, flown = self._fly(some, copter)
            after = grid_s >= steps_s[0]
            altitudes[row, after] = np.interp(grid_s[after], steps_s, flown[:, FLOWN.index("z_m")])
        return altitudes

    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:
        """Altitudes of simulated flights, and the margin from ringing, on a few copters of the distribution; nothing is
        simulated with parameters with which the replica does not hold. A known hover throttle that the autopilot's
        parameter does not suit is told."""
        if self.unfit:
            return tuple(
                Check(
                    "parameters",
                    False,
                    f"The vehicle's {each.field} {each.reason}; otherwise the model of its loop does not hold. Set it "
                    "on the vehicle, and mark the flights with the other value invalid.",
                    worst=math.inf,
                    limit=0.0,
                )
                for each in self.unfit
            )
        models = spread.sample(self, COPTERS)
        altitudes = self.outputs(np.tile(gains, (COPTERS, 1)), models)
        return (
            *check_altitudes(altitudes, self.set_points, envelope.ceiling_m),
            check_margin(self.loop(gains), [copter_of(model) for model in models]),
            *check_hover(self.advise_hover(spread.mean[0]), spread.mean[0], math.sqrt(spread.covariance[0][0])),
        )

    def advise_hover(self, hover_throttle: float) -> HoverAdvice | None:
        """Advice for a vehicle that hovers with this throttle; None if its parameter suits, or was not recorded."""
        loop = self.loop(self.space.default)
        return advise_hover(loop, hover_throttle) if loop.texts.hover_parameter in self.parameters else None

    def _fly(self, gains: Vector, model: Vector) -> tuple[Samples, Samples]:
        """Times of the loop's steps, shape (m,), and what is flown in still air, (m, 6) as `FLOWN`."""
        loop, copter = self.loop(gains), copter_of(model)
        steps_s = self.steps.steps_s(loop.step_s)
        reference = self.references(steps_s)
        reference[:, 3] = found_hover(loop, copter.hover_throttle)
        run = Run(
            copter=loop.packed(copter),
            reference=reference,
            disturbances=np.zeros((len(steps_s), len(DISTURBANCES))),
            start=(copter.hover_throttle, float(reference[0, 0]), 0.0, 0.0),
        )
        return steps_s, loop.fly(run)

    @property
    def followed_m(self) -> Samples:
        """The altitude that the loop follows, on the grid, shape (n,)."""
        grid_s = self.grid_s
        step_s = self.loop(self.space.default).step_s
        steps_s = np.arange(0.0, grid_s[-1] + step_s, step_s)
        return np.interp(grid_s, steps_s, self.references(steps_s)[:, 0])


def check_altitudes(altitudes: Matrix, set_points: SetPoints, ceiling_m: float) -> tuple[Check, Check]:
    """Highest and lowest altitude of simulated flights, shape (k, n): below the ceiling, and above half of the lowest
    set point."""
    highest_m, lowest_m, floor_m = float(altitudes.max()), float(altitudes.min()), 0.5 * min(set_points.altitudes_m)

    def check(name: str, end: str, verb: str, worst: float, limit: float, passed: bool) -> Check:
        does = f"{verb}s" if passed else f"would {verb}"
        flights = f"The {end} of {len(altitudes)} simulated flights {does} to {number(worst, 2)} m"
        return Check(name, passed, f"{flights}; {limit:g} m is allowed.", worst=worst, limit=limit)

    return (
        check("altitude", "highest", "rise", highest_m, ceiling_m, highest_m <= ceiling_m),
        check("lowest altitude", "lowest", "fall", lowest_m, floor_m, lowest_m >= floor_m),
    )


def check_hover(advice: HoverAdvice | None, hover_throttle: float, deviation: float) -> tuple[Check, ...]:
    """A check that passes, and says that the vehicle hovers outside what its autopilot finds in flight; none if it does
    not, or while flights have not shown the hover throttle. No refusal: only another flight can show that the parameter
    was set."""
    if advice is None or not advice.is_outside or deviation > _KNOWN_TO:
        return ()
    sentence = f"{advice.reason} Do this before the flight."
    return (Check("hover throttle", True, sentence, worst=hover_throttle, limit=advice.found),)


def check_margin(loop: LinearLoop[_V], vehicles: Sequence[_V]) -> Check:
    """Whether the loop rings with none of the vehicles (`robust_damping`), of which the first is the likeliest."""
    damping = robust_damping(loop, vehicles)
    passed = damping >= RINGING_DAMPING
    return Check(
        "margin",
        passed,
        f"With up to {REQUIRED_MARGIN:g} times the {loop.texts.fast_gains}, and {1e3 * EXTRA_LAG_S:.0f} ms more "
        f"{loop.texts.lateness} for the likeliest vehicle, the least damped of {len(vehicles)} likely vehicles has a "
        f"damping ratio of {damping:.2f}; {'at least ' if passed else ''}{RINGING_DAMPING:g} is needed.",
        worst=damping,
        limit=RINGING_DAMPING,
    )
