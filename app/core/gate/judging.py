"""The gate's verdict on one policy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from app.core.calibration import known_distribution
from app.core.checks import Check
from app.core.definition import Definition, Flight
from app.core.envelope import envelope_of
from app.core.experiments.base import Experiment
from app.core.gate.bounds import NUMBERS, check_bounds, check_numbers, check_step, jointly_offered
from app.core.policy import Gains, PolicySpace
from app.core.spread import ParameterDistribution
from app.core.starting import start_gains
from app.core.strategies.history import was_flown

WAIVED_AFTER_VALID_FLIGHT: Final = frozenset({"altitude", "divergence"})
"""Checks of simulated takeoffs that do not refuse gains flown before."""


@dataclass(frozen=True, slots=True)
class GateResult:
    """Verdict on one policy; each check has its worst value and the case that caused it."""

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)

    @property
    def refusals(self) -> tuple[Check, ...]:
        return tuple(check for check in self.checks if not check.passed)

    @property
    def overrulable(self) -> bool:
        """Whether a controller can hold these gains at all."""
        return not any(check.name == NUMBERS for check in self.checks)


def check_policy(
    definition: Definition,
    experiment: Experiment,
    space: PolicySpace,
    gains: Gains,
    flights: Sequence[Flight],
    *,
    start: Gains | None = None,
    spread: ParameterDistribution | None = None,
) -> GateResult:
    """Check a complete set of gains (every name of `space`).

    Checks the numbers, the campaign's bounds, its step limit, and the experiment's hazards if it has a model. Gains of
    a valid flight of this campaign may fly again even if simulated takeoffs exceed the altitude or diverge, because the
    flight is better evidence. Pure; takes a tenth of a second for a takeoff.

    `space` is the experiment's, narrowed to the campaign's bounds. Before the first valid flight a gain may change by
    `first_step_fraction` of its range from the start gains, afterwards by `step_fraction` from any valid flight.
    `start` gives the start gains if they are known, because the search on the model is slow. `spread` gives the
    vehicle's parameter distribution, for `flights` without their records.
    """
    if numbers := check_numbers(space, gains):
        return GateResult(numbers)
    hazards = _hazards(
        definition, experiment, space, gains, known_distribution(experiment, flights) if spread is None else spread
    )
    if was_flown(gains, [flight for flight in flights if flight.outcome == "valid"]):
        hazards = tuple(_flown_before(check) for check in hazards)
    limits = (*check_bounds(space, gains), _step(definition, experiment, space, gains, flights, start))
    return GateResult(jointly_offered(gains, (*limits, *hazards)))


def _hazards(
    definition: Definition, experiment: Experiment, space: PolicySpace, gains: Gains, spread: ParameterDistribution
) -> tuple[Check, ...]:
    modelled = experiment.modelled
    if modelled is None:
        return ()
    return modelled.hazards(space.vector(gains), spread, envelope_of(definition, experiment))


def _flown_before(check: Check) -> Check:
    """The check's result for gains that a valid flight of the campaign has flown."""
    if check.passed or check.name not in WAIVED_AFTER_VALID_FLIGHT:
        return check
    sentence = f"{check.sentence} But a flight of this campaign flew these gains to its end, so they may fly again."
    return replace(check, passed=True, sentence=sentence)


def _step(
    definition: Definition,
    experiment: Experiment,
    space: PolicySpace,
    gains: Gains,
    flights: Sequence[Flight],
    start: Gains | None,
) -> Check:
    flown = [flight.gains for flight in flights if flight.outcome == "valid"]
    if flown:
        return check_step(space, gains, flown, definition.step_fraction, "a flown set")
    origin = start_gains(definition, experiment, space) if start is None else start
    fraction = definition.first_step_fraction
    return check_step(space, gains, [origin], fraction, "the start gains until a flight has shown more")
