"""What a policy must pass before it may be flown, on every path: proposals, manual gains, scripts.

Here are the bounds and the step limits; each check answers with its worst number.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from app.core.definition import Definition, Flight
from app.core.experiments.base import Experiment
from app.core.policy import Gain, Gains, PolicySpace
from app.core.starting import start_gains


@dataclass(frozen=True, slots=True)
class Check:
    """One check: its worst number, in the same measure as the limit it is held against, and the gain that has it."""

    name: str
    passed: bool
    sentence: str
    worst: float
    limit: float
    gain: str


@dataclass(frozen=True, slots=True)
class Gate:
    """The verdict on one policy."""

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)


def check_policy(
    definition: Definition,
    experiment: Experiment,
    space: PolicySpace,
    gains: Gains,
    flights: Sequence[Flight],
    *,
    start: Gains | None = None,
) -> Gate:
    """Judge a complete set of gains (every name of `space`) against the campaign's bounds and its step limit.

    `space` is the experiment's, narrowed to the campaign's bounds. Before the first valid flight a gain may change by
    `first_step_fraction` of its range from the start gains, afterwards by `step_fraction` from some valid flight.
    `start`: the start gains where they are known; searching them on the model takes long.
    """
    bounds = _bounds(space, gains)
    if not bounds.passed:
        return Gate((bounds,))
    valid = [flight for flight in flights if flight.outcome == "valid"]
    if valid:
        step = _step(space, gains, [flight.gains for flight in valid], definition.step_fraction, "a flown set")
    else:
        step = _step(
            space,
            gains,
            [start_gains(definition, experiment, space) if start is None else start],
            definition.first_step_fraction,
            "the start gains until a flight has shown more",
        )
    return Gate((bounds, step))


def _bounds(space: PolicySpace, gains: Gains) -> Check:
    refusals = [f"{gain.name} {reason}" for gain in space.gains if (reason := gain.refusal(gains[gain.name]))]
    outside, name = max((_outside(gain, gains[gain.name]), gain.name) for gain in space.gains)
    sentence = f"{'; '.join(refusals)}." if refusals else "Every gain lies within its bounds."
    return Check("bounds", not refusals, sentence, worst=outside, limit=0.0, gain=name if refusals else "")


def _outside(gain: Gain, value: float) -> float:
    """How far beyond its bounds a gain lies, as a share of its range; infinite for one that is pinned or no number."""
    beyond = max(gain.lower - value, value - gain.upper, 0.0)
    if beyond == 0.0:
        return 0.0
    return beyond / gain.span if gain.span and math.isfinite(value) else math.inf


def _step(space: PolicySpace, gains: Gains, references: Sequence[Gains], fraction: float, origin: str) -> Check:
    nearest = min(references, key=lambda reference: max(space.change(gains, reference).values()))
    name, worst = max(space.change(gains, nearest).items(), key=lambda item: item[1])
    low, high = space.reachable(space.vector(nearest), fraction)
    passed = bool(((low <= space.vector(gains)) & (space.vector(gains) <= high)).all())
    sentence = (
        f"The largest change, of {name}, is {worst:.1%} of its range; "
        f"{'at most' if passed else 'only'} {fraction:.0%} is allowed from {origin}."
    )
    return Check("step", passed, sentence, worst=worst, limit=fraction, gain="" if passed else name)
