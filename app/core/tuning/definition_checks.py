"""Validation of a campaign's definition, before it is frozen."""

import math
from collections.abc import Iterator, Mapping
from typing import Final

from app.core.definition import Definition, LogEvidence, StopRule, problems_of_options
from app.core.errors import InputError, Problem
from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.experiments.copter_steps import CopterSteps
from app.core.policy import PolicySpace
from app.core.tuning.strategies import STRATEGIES
from app.core.tuning.strategies.simplex import SIMPLEX

MAX_FLIGHTS: Final = 200
MAX_IMPROVEMENT: Final = 0.5
MIN_CEILING_M: Final = 3.2
CEILING_MARGIN_M: Final = 0.2
"""Least room between the highest set point and the ceiling."""
MAX_CEILING_M: Final = 100.0
MIN_CONFIDENCE: Final = 0.5
MAX_SEED: Final = 2**53 - 1
"""Highest whole number up to which a JSON number is exact."""
_LARGEST_DEVIATION: Final = 100.0
"""Far beyond the range of every parameter of a vehicle's model; the square of any such number is finite."""


def problems_of(definition: Definition, experiments: Mapping[str, Experiment]) -> tuple[Problem, ...]:
    """All problems of a definition with one of these experiments, each with its field (`stop.max_flights`, …)."""
    experiment = experiments.get(definition.experiment)
    return (
        *_names(definition, experiments),
        *_options(definition, experiment),
        *_steps(definition, experiment),
        *_fit(definition, experiments),
        *_policy(definition, experiment),
        *_fractions(definition),
        *_ceiling(definition, experiment),
        *_stop(definition.stop),
        *_seed(definition.seed),
    )


def _names(definition: Definition, experiments: Mapping[str, Experiment]) -> Iterator[Problem]:
    if definition.experiment not in experiments:
        yield Problem("experiment", f"must be one of {', '.join(experiments)}, got {definition.experiment!r}")
    if definition.strategy not in STRATEGIES:
        yield Problem("strategy", f"must be one of {', '.join(STRATEGIES)}, got {definition.strategy!r}")


def _options(definition: Definition, experiment: Experiment | None) -> Iterator[Problem]:
    if definition.strategy in STRATEGIES:
        strategy = STRATEGIES[definition.strategy]
        yield from problems_of_options(definition.options, strategy.options, field="options", owner=strategy.name)
    if experiment is not None:
        yield from problems_of_options(
            definition.experiment_options, experiment.options, field="experiment_options", owner=experiment.name
        )


def _fit(definition: Definition, experiments: Mapping[str, Experiment]) -> Iterator[Problem]:
    if definition.strategy not in STRATEGIES or definition.experiment not in experiments:
        return
    strategy, experiment = STRATEGIES[definition.strategy], experiments[definition.experiment]
    if not isinstance(experiment, ModelledExperiment):
        yield from _without_model(definition)
        return
    wanted = {"strategy": strategy} | ({"start.kind": SIMPLEX} if definition.start.kind == "simplex" else {})
    for field, chosen in wanted.items():
        if not chosen.works_with(experiment):
            fitting = ", ".join(name for name, each in experiments.items() if chosen.works_with(each))
            yield Problem(field, f"{chosen.name!r} works only with {fitting}")


def _without_model(definition: Definition) -> Iterator[Problem]:
    lacks = f"there is no model for the gains of {definition.experiment!r}"
    if STRATEGIES[definition.strategy].needs_model:
        by_hand = ", ".join(repr(name) for name, strategy in STRATEGIES.items() if not strategy.needs_model)
        yield Problem("strategy", f"{definition.strategy!r} needs a model, and {lacks}: choose {by_hand}")
    if definition.start.kind == "simplex":
        yield Problem("start.kind", f"'simplex' needs a model, and {lacks}: choose 'default' or 'given'")


def _policy(definition: Definition, experiment: Experiment | None) -> Iterator[Problem]:
    if experiment is None:
        return
    space = experiment.space
    try:
        space = space.narrowed(definition.bounds)
    except InputError as error:
        yield from error.problems
    try:
        yield from _start(definition, experiment, space)
    except InputError as error:
        yield from error.problems


def _start(definition: Definition, experiment: Experiment, space: PolicySpace) -> Iterator[Problem]:
    """Raises InputError for gains that are missing, unknown or refused."""
    start = definition.start
    if (start.kind in {"given", "campaign"}) != (start.gains is not None):
        required = "required" if start.gains is None else "not allowed"
        yield Problem("start.gains", f"are {required} with start.kind {start.kind!r}")
    elif (start.kind == "campaign") != (start.donor is not None):
        yield Problem("start.donor", "is required with start.kind 'campaign', and not allowed with any other")
    elif start.log is not None and (problems := tuple(_log(definition, experiment, start.log))):
        yield from problems
    elif start.kind == "given" and start.gains is not None:
        space.check(start.gains, field="start.gains")
    elif start.kind != "simplex":
        yield from _left_out(space, space.complete(start.gains or space.mapping(space.default), field="start.gains"))


def _log(definition: Definition, experiment: Experiment, log: LogEvidence) -> Iterator[Problem]:
    if definition.start.kind != "given" or not isinstance(experiment, CopterSteps):
        reason = "is allowed only with start.kind 'given', for altitude steps under ArduCopter or PX4"
        yield Problem("start.log", reason)
        return
    known = {each.name: (each.lower, each.upper) for each in experiment.model_parameters}
    if log.vehicle.keys() != known.keys():
        yield Problem("start.log.vehicle", f"must have {', '.join(known)}")
        return
    wrong = [
        Problem(
            f"start.log.vehicle.{name}",
            f"must be {low:g} … {high:g}, with a standard deviation of 0 … {_LARGEST_DEVIATION:g}",
        )
        for name, (low, high) in known.items()
        if not (low <= log.vehicle[name][0] <= high and 0.0 <= log.vehicle[name][1] <= _LARGEST_DEVIATION)
    ]
    yield from wrong or _unmodelled(experiment, log)


def _unmodelled(experiment: CopterSteps, log: LogEvidence) -> Iterator[Problem]:
    try:
        experiment.exactly_under(log.parameters)
    except InputError as error:
        yield from (Problem(f"start.log.parameters.{each.field}", each.reason) for each in error.problems)


def _left_out(space: PolicySpace, gains: Mapping[str, float]) -> Iterator[Problem]:
    """Gains that the definition does not name are not at fault: the bounds are, because they leave them out."""
    for gain in space.gains:
        if gain.refusal_by_bounds(gains[gain.name]) is not None:
            found = f"got {gain.lower:g} … {gain.upper:g}"
            yield Problem(f"bounds.{gain.name}", f"must hold the start gain {gains[gain.name]:g}, {found}")


def _fractions(definition: Definition) -> Iterator[Problem]:
    for name in ("first_step_fraction", "step_fraction"):
        value = getattr(definition, name)
        if not 0.0 < value <= 1.0:
            yield Problem(name, f"must be above 0 and at most 1, got {value:g}")


def _ceiling(definition: Definition, experiment: Experiment | None) -> Iterator[Problem]:
    lowest_m = max(MIN_CEILING_M, highest_set_point_m(definition, experiment) + CEILING_MARGIN_M)
    if not (math.isfinite(definition.ceiling_m) and lowest_m <= definition.ceiling_m <= MAX_CEILING_M):
        yield Problem(
            "ceiling_m", f"must be between {lowest_m:g} and {MAX_CEILING_M:g} m, got {definition.ceiling_m:g}"
        )


def highest_set_point_m(definition: Definition, experiment: Experiment | None) -> float:
    """Zero where the experiment is unknown, has options that are refused, or has no altitude."""
    return max(_altitudes_m(definition, experiment), default=0.0)


def _altitudes_m(definition: Definition, experiment: Experiment | None) -> tuple[float, ...]:
    """The set points; none where the experiment is unknown, has options that are refused, or has no altitude."""
    chosen = definition.experiment_options
    if experiment is None or any(problems_of_options(chosen, experiment.options, field="", owner=experiment.name)):
        return ()
    set_points = experiment.configured(chosen).set_points
    return () if set_points is None else set_points.altitudes_m


def _steps(definition: Definition, experiment: Experiment | None) -> Iterator[Problem]:
    """A set point below half of the highest one looks like an aborted flight in a record."""
    altitudes_m = _altitudes_m(definition, experiment)
    if altitudes_m and min(altitudes_m) <= 0.5 * max(altitudes_m):
        yield Problem(
            "experiment_options.step_m",
            f"must be below {0.5 * max(altitudes_m):g} m, half of the highest set point, got "
            f"{max(altitudes_m) - min(altitudes_m):g} m",
        )


def _stop(rule: StopRule) -> Iterator[Problem]:
    if not 1 <= rule.max_flights <= MAX_FLIGHTS:
        yield Problem("stop.max_flights", f"must be between 1 and {MAX_FLIGHTS}, got {rule.max_flights}")
    if not (math.isfinite(rule.improvement) and 0.0 <= rule.improvement <= MAX_IMPROVEMENT):
        yield Problem("stop.improvement", f"must be between 0 and {MAX_IMPROVEMENT:g}, got {rule.improvement:g}")
    if not MIN_CONFIDENCE <= rule.confidence < 1.0:
        yield Problem("stop.confidence", f"must be at least {MIN_CONFIDENCE:g} and below 1, got {rule.confidence:g}")
    if rule.min_battery_v is not None and not (math.isfinite(rule.min_battery_v) and rule.min_battery_v > 0.0):
        yield Problem("stop.min_battery_v", f"must be above 0 V, got {rule.min_battery_v:g}")


def _seed(seed: int) -> Iterator[Problem]:
    if not 0 <= seed <= MAX_SEED:
        yield Problem("seed", f"must be between 0 and {MAX_SEED}, got {seed}")
