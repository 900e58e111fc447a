"""What an analysis asks of an autopilot's altitude loop: its gains and their limits, a flight with other gains, its
linear model in hover, and its words; and a flight as a log holds it, with the loop that flew it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol, Self, TypeVar

import numpy as np

from app.core.analysis.segment import Segment, Steps
from app.core.models.copter import BODY_SIZE, Copter, Filter
from app.core.reasons import Reason
from app.core.records.trajectory import Samples

_V_contra = TypeVar("_V_contra", contravariant=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class MarginTexts:
    """`fast_gains` are those that a margin scales, and `lateness` is what it adds to the vehicle."""

    fast_gains: str
    lateness: str


class LinearLoop(Protocol[_V_contra]):
    """What a margin asks of a loop, about hover on a model of its vehicle; immutable."""

    @property
    def texts(self) -> MarginTexts:
        """Its names and sentences."""

    @property
    def step_s(self) -> float:
        """Duration of a step."""

    def with_fast_gains(self, factor: float) -> Self:
        """The loop with this factor on the gains that all feedback passes through."""

    def transition(self, vehicle: _V_contra, /, *, late_s: float = 0.0) -> Samples:
        """Derivative of the state of loop and vehicle after a step in hover with respect to that before, shape
        (k, k); the vehicle follows `late_s` later than it does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GainSpace:
    """Gains that are proposed, by the firmware's names: their documented ranges, a gentle set that rings on hardly any
    vehicle, and the same order of names in both.

    `zeros` are added to gains that may be 0, of which a search takes the logarithm. `ordered` names a gain that must
    not exceed another.
    """

    bounds: Mapping[str, tuple[float, float]]
    gentle: Mapping[str, float]
    zeros: Mapping[str, float] = field(default_factory=dict)
    ordered: tuple[str, str] | None = None

    def coordinates(self, gains: Mapping[str, float]) -> Samples:
        """Logarithms of the gains within their ranges, shape (k,)."""
        return np.log([float(np.clip(gains[name], *self.bounds[name])) + self.zero(name) for name in self.bounds])

    def gains_at(self, coordinates: Samples) -> dict[str, float]:
        """Gains at these coordinates, shape (k,)."""
        values = np.exp(coordinates).tolist()
        return {name: value - self.zero(name) for name, value in zip(self.bounds, values, strict=True)}

    def disorder(self, coordinates: Samples) -> list[float]:
        """How far, as a logarithm, a gain exceeds the one that it must not, if there is such an order."""
        names = list(self.bounds)
        places = [] if self.ordered is None else [tuple(map(names.index, self.ordered))]
        return [float(coordinates[lower] - coordinates[higher]) for lower, higher in places]

    def zero(self, name: str) -> float:
        """What is added to this gain before its logarithm."""
        return self.zeros.get(name, 0.0)

    def at_limit(self, gains: Mapping[str, float]) -> list[str]:
        """Names of the gains at an end of their range, but for an end of 0, which switches a term off."""
        return [name for name, ends in self.bounds.items() if gains[name] and gains[name] in ends]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTexts(MarginTexts):
    """Names and sentences about a loop.

    `prefix` is that of its parameters. `hover_parameter` holds the hover throttle that it assumes, within
    `hover_range`; `hover_use` says what for, and `hover_deviation` names the parameter of how far an estimate may be
    from it, if there is one. `what_to_fly` answers a log that does not suffice, `lags` what to reduce if no gains do.
    """

    autopilot: str
    prefix: str
    hover_parameter: str
    hover_range: tuple[float, float]
    hover_use: str
    what_to_fly: str
    lags: str
    parameter_suffix: str
    hover_deviation: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A segment for one copter, as packed by the loop: reference and disturbances at every step, shape (m, 4) each, and
    the throttle, altitude, climb rate and acceleration to start with."""

    copter: Samples
    reference: Samples
    disturbances: Samples
    start: tuple[float, float, float, float]


class AltitudeLoop(LinearLoop[Copter], Protocol):
    """An autopilot's altitude loop with the parameters of a flight."""

    @property
    def texts(self) -> LoopTexts:
        """Its names and sentences."""

    @property
    def space(self) -> GainSpace:
        """The gains to choose."""

    @property
    def gains(self) -> dict[str, float]:
        """The gains of its space, as they are."""

    @property
    def firmware_parameters(self) -> dict[str, float]:
        """All that it depends on, by the names of the firmware; ArduCopter's by those until release 4.6."""

    @property
    def assumed_hover_throttle(self) -> float:
        """The parameter for the throttle in hover."""

    @property
    def hover_limits(self) -> tuple[float, float] | None:
        """Least and largest hover throttle that the loop finds in flight; None if it keeps to its parameter."""

    @property
    def throttle_limits(self) -> tuple[float, float]:
        """Least and largest throttle."""

    @property
    def usual_slope(self) -> tuple[float, float]:
        """Mean and standard deviation, over vehicles under this autopilot, of the slope of log thrust over log
        throttle."""

    @property
    def slope_error(self) -> float:
        """Standard deviation of the fitted slope that comes from the vehicle's estimator, beyond gusts and noise."""

    @property
    def target_tolerance_m_s(self) -> float:
        """How far a logged climb rate target may be from `climb_rate_targets`."""

    @property
    def accelerometer(self) -> Filter:
        """The filter between the vehicle's acceleration and that in the log."""

    @property
    def sensor(self) -> Filter:
        """The filter between the vehicle's acceleration and that which the loop controls."""

    def named(self, gains: Mapping[str, float]) -> dict[str, float]:
        """Gains by the names and in the units of the vehicle's release."""

    def rules(self, hover_throttle: float) -> dict[str, dict[str, float]]:
        """Gains that are set without a model, by name."""

    def parameter_lines(self, flown: Mapping[str, float], proposed: Mapping[str, float]) -> list[str]:
        """Lines of a parameter file with the proposed gains, by the names of the release, those flown as comments."""

    def with_gains(self, gains: Mapping[str, float]) -> Self:
        """The loop with other values of these gains."""

    def with_hover(self, hover_throttle: float) -> Self:
        """The loop with another value of the parameter for the throttle in hover."""

    def climb_rate_targets(self, segment: Segment) -> Samples:
        """What the climb rate target of each row must be, shape (n,)."""

    def excitation(self, segment: Segment, throttle: float) -> tuple[Samples, Samples]:
        """Climb rate and acceleration at each row, shape (n,) each, that follow from the reference alone; `throttle` is
        that of the flight on average."""

    def start(self, steps: Steps) -> tuple[float, float]:
        """Climb rate and acceleration to start a segment with."""

    def packed(self, copter: Copter) -> Samples:
        """The copter as `fly` takes it."""

    def fly(self, run: Run) -> Samples:
        """Fly a run, shape (m, 6) as `FLOWN`."""


def in_order(gains: Mapping[str, float]) -> str:
    """The values of a gain set in a line."""
    return ", ".join(f"{value:g}" for value in gains.values())


def mean_over(row_s: float, step_s: float) -> Filter:
    """The mean over the steps of the row before: the change of the climb rate as an acceleration."""
    steps = max(round(row_s / step_s), 1)
    return np.append(0.0, np.full(steps, 1.0 / steps)), np.append(1.0, np.zeros(steps))


def transition_of(after_step: Callable[[Samples], Samples], loop_size: int, nudge: float) -> Samples:
    """Derivative of a state after a step, shape (k, k), by central differences of the step itself.

    `after_step` takes what is added to the state before, shape (k,): the loop's part, then the body's.
    """
    nudges = nudge * np.eye(loop_size + BODY_SIZE)
    return np.column_stack([(after_step(each) - after_step(-each)) / (2.0 * nudge) for each in nudges])


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedFlight:
    """Segments of one flight with the same parameters, and the loop with these.

    `activity` is the standard deviation of the demanded throttle about its own 2 Hz low-pass, share of full, if it was
    recorded: the noise of an accelerometer that is not in the log follows from it. `assumed` names parameters that the
    record lacks, so that the loop has the firmware's defaults. `lacks` is why other gains cannot be predicted, if so.
    """

    loop: AltitudeLoop
    segments: Sequence[Segment]
    activity: float | None = None
    assumed: Sequence[str] = ()
    lacks: Reason | None = None

    @property
    def error_m(self) -> float:
        """Mean distance between reference and altitude, over the scored rows of all segments."""
        return float(np.mean(np.concatenate([np.abs(each.z_d_m - each.z_m)[each.scored] for each in self.segments])))

    def with_hover(self, hover_throttle: float) -> Self:
        """The flight under a loop with another value of its parameter for the throttle in hover, which it keeps."""
        segments = [
            replace(each, assumed_hover=np.full_like(each.assumed_hover, hover_throttle)) for each in self.segments
        ]
        return replace(self, loop=self.loop.with_hover(hover_throttle), segments=segments)

    @property
    def throttle_mean(self) -> float:
        """Mean throttle of all segments."""
        return float(np.mean(np.concatenate([each.throttle_filtered for each in self.segments])))
