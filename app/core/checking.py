"""Whether a campaign's definition can be used, before it is frozen."""

import math
from collections.abc import Iterator
from typing import Final

from app.core.definition import Definition, StopRule
from app.core.errors import InputError, Problem
from app.core.experiments import EXPERIMENTS
from app.core.policy import PolicySpace
from app.core.strategies import STRATEGIES

MAX_FLIGHTS: Final = 200
MAX_IMPROVEMENT: Final = 0.5


def check_definition(definition: Definition) -> None:
    """Raise InputError naming every field that cannot be used."""
    if problems := problems_of(definition):
        raise InputError(
            "This campaign definition cannot be used.",
            problems=problems,
            hint="Correct the named fields and try again; nothing was changed.",
        )


def problems_of(definition: Definition) -> tuple[Problem, ...]:
    """Every reason against the definition, each with its field (`stop.max_flights`, `bounds.kp`, …)."""
    return (
        *_names(definition),
        *_options(definition),
        *_policy(definition),
        *_fractions(definition),
        *_stop(definition.stop),
        *_seed(definition.seed),
    )


def _names(definition: Definition) -> Iterator[Problem]:
    if definition.experiment not in EXPERIMENTS:
        yield Problem("experiment", f"must be one of {', '.join(EXPERIMENTS)}, got {definition.experiment!r}")
    if definition.strategy not in STRATEGIES:
        yield Problem("strategy", f"must be one of {', '.join(STRATEGIES)}, got {definition.strategy!r}")


def _options(definition: Definition) -> Iterator[Problem]:
    if definition.strategy not in STRATEGIES:
        return
    known = {option.name: option for option in STRATEGIES[definition.strategy].options}
    for name, value in definition.options.items():
        if name not in known:
            offered = ", ".join(known) or "none"
            yield Problem(f"options.{name}", f"is not an option of {definition.strategy} (it has: {offered})")
        elif not any(value == choice and type(value) is type(choice) for choice in known[name].choices):
            choices = ", ".join(str(choice).lower() for choice in known[name].choices)
            yield Problem(f"options.{name}", f"must be one of {choices}, got {value!r}")


def _policy(definition: Definition) -> tuple[Problem, ...]:
    if definition.experiment not in EXPERIMENTS:
        return ()
    try:
        space = EXPERIMENTS[definition.experiment].space.narrowed(definition.bounds)
        _check_start(definition, space)
    except InputError as error:
        return error.problems
    return ()


def _check_start(definition: Definition, space: PolicySpace) -> None:
    start = definition.start
    if (start.kind == "given") != (start.gains is not None):
        reason = "are needed with start.kind 'given'" if start.gains is None else "go only with start.kind 'given'"
        raise InputError("The start cannot be used.", hint="", problems=(Problem("start.gains", reason),))
    if start.kind != "simplex":
        space.check(start.gains or space.mapping(space.default), field="start.gains")


def _fractions(definition: Definition) -> Iterator[Problem]:
    for name in ("first_step_fraction", "step_fraction"):
        value = getattr(definition, name)
        if not 0.0 < value <= 1.0:
            yield Problem(name, f"must be above 0 and at most 1, got {value:g}")


def _stop(rule: StopRule) -> Iterator[Problem]:
    if not 1 <= rule.max_flights <= MAX_FLIGHTS:
        yield Problem("stop.max_flights", f"must lie in 1 … {MAX_FLIGHTS}, got {rule.max_flights}")
    if not (math.isfinite(rule.improvement) and 0.0 <= rule.improvement <= MAX_IMPROVEMENT):
        yield Problem("stop.improvement", f"must lie in 0 … {MAX_IMPROVEMENT:g}, got {rule.improvement:g}")


def _seed(seed: int) -> Iterator[Problem]:
    if seed < 0:
        yield Problem("seed", f"must not be negative, got {seed}")
