"""Decides whether further steps can be distinguished from noise, and whether the winner is better than the first gains.

There are two phases. *Steps* are worth flying while the predicted improvement is at least what the remaining flights
could distinguish from noise. After that, the winner and the baseline (the first flight's gains) are flown again in turn
until the difference is decided. The confidence allows for the number of policies from which the winner was chosen, and
for every repeated comparison. Gains outside the campaign's bounds, flown by overruling a refusal, would be refused
again and are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final, Literal

from app.core.definition import Definition, Flight
from app.core.experiments.base import Experiment
from app.core.formatting import confidence_text, count, format_gains, percent, plus_minus, short, times
from app.core.statistics.comparisons import (
    Comparison,
    FlightsToDecide,
    Group,
    PooledScatter,
    compare,
    groups_of,
    pool_scatter,
    select_winner,
    smallest_difference,
)
from app.core.tuning.strategy import Proposal

_NONE_BETTER: Final = MappingProxyType({0: "No other gains were flown.", 1: "The other gain set flown is not better."})

SCATTER_NOT_KNOWN: Final = (
    "The flight-to-flight scatter under this autopilot is unknown, so the difference cannot be tested. Fly one of "
    "the gain sets again."
)

NO_STEP: Final = "No further step is flown:"

_CONFIRMATION_FLIGHTS: Final = 2
"""Flights reserved for repeating the winner and the baseline."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonState:
    """Comparison of the flights so far; at least one is valid.

    `baseline` is the group of the first valid flight, `winner` the best policy; `comparison` of the two is None while
    they are the same.
    """

    groups: tuple[Group, ...]
    scatter: PooledScatter
    baseline: Group
    winner: Group
    comparison: Comparison | None

    @property
    def looks(self) -> int:
        """Number of comparisons since both policies were repeated; 0 before."""
        if min(self.winner.size, self.baseline.size) < 2:
            return 0
        return self.winner.size + self.baseline.size - 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """What to fly next: the strategy's step, the winner again, the baseline again, or nothing more, and why."""

    phase: Literal["step", "repeat", "baseline", "decided"]
    why: str


def compare_winner(definition: Definition, experiment: Experiment, flights: Sequence[Flight]) -> ComparisonState | None:
    """Groups, scatter and winner of the flights; None before the first valid flight.

    Under the stop rule `noise` the confidence allows for repeated comparisons; under the other rules, which do not
    decide by it, only for the choice among the policies.
    """
    groups = groups_of(flights)
    if not groups:
        return None
    scatter = pool_scatter(groups, experiment.scatter)
    baseline, winner = groups[0], select_winner(groups, scatter)
    bare = ComparisonState(groups=groups, scatter=scatter, baseline=baseline, winner=winner, comparison=None)
    if winner is baseline:
        return bare
    comparison = compare(
        winner,
        baseline,
        scatter,
        definition.stop.confidence,
        candidates=len(groups) - 1,
        looks=bare.looks if definition.stop.kind == "noise" else 0,
    )
    return ComparisonState(groups=groups, scatter=scatter, baseline=baseline, winner=winner, comparison=comparison)


def standing_within_bounds(
    definition: Definition, experiment: Experiment, flights: Sequence[Flight]
) -> ComparisonState | None:
    """The comparison among gains inside the bounds, which may be flown again. None if there are none."""
    return compare_winner(definition, experiment, _inside(definition, experiment, flights))


def confirm(
    definition: Definition, experiment: Experiment, flights: Sequence[Flight], proposal: Proposal
) -> Confirmation:
    """Choose the next flight under the stop rule `noise`. At least one valid flight must lie inside the bounds.

    A proposal of kind `manual` predicts no improvement and counts as worth a flight until the flights run short.
    """
    inside = _inside(definition, experiment, flights)
    now = compare_winner(definition, experiment, inside)
    assert now is not None
    found = _next(definition, experiment, now, definition.stop.max_flights - len(flights), proposal)
    return replace(found, why=f"{found.why} {_left_out(flights, inside)}".strip())


def _inside(definition: Definition, experiment: Experiment, flights: Sequence[Flight]) -> Sequence[Flight]:
    space = experiment.space.narrowed(definition.bounds)
    return [
        flight
        for flight in flights
        if all(gain.refusal_by_bounds(flight.gains[gain.name]) is None for gain in space.gains)
    ]


def _left_out(flights: Sequence[Flight], inside: Sequence[Flight]) -> str:
    within = {flight.number for flight in inside}
    out = [str(flight.number) for flight in flights if flight.number not in within]
    if not out:
        return ""
    do = ("Flight", "lies", "is") if len(out) == 1 else ("Flights", "lie", "are")
    return f"{do[0]} {', '.join(out)} {do[1]} outside the bounds and {do[2]} not compared."


def _next(
    definition: Definition, experiment: Experiment, now: ComparisonState, left: int, proposal: Proposal
) -> Confirmation:
    if now.winner is now.baseline:
        return _confirm_baseline(definition, experiment, now, left, proposal)
    if left <= 0:
        return Confirmation(phase="decided", why=verdict_sentence(experiment, now))
    if obstacle := _obstacle_to_step(definition, experiment, now, left, proposal):
        again = _flown_again(experiment, now)
        return replace(again, why=f"{again.why} {obstacle}")
    return Confirmation(phase="step", why=_describe_improvement(definition, experiment, now, left, proposal))


def describe_step(
    definition: Definition, experiment: Experiment, flights: Sequence[Flight], now: ComparisonState, proposal: Proposal
) -> str:
    """Predicted improvement of a step beside what the remaining flights, at least one, can distinguish from noise;
    empty for a `manual` proposal."""
    left = definition.stop.max_flights - len(flights)
    if _is_worth_a_step(definition, now, left, proposal):
        return _describe_improvement(definition, experiment, now, left, proposal)
    return f"This step {_lack(definition, experiment, now, left, proposal)}"


def verdict_sentence(experiment: Experiment, now: ComparisonState) -> str:
    """The winner compared with the first gains, in a sentence."""
    if now.comparison is None:
        return f"The first flight's gains ({format_gains(now.baseline.gains)}) are the best flown."
    unit, comparison = experiment.error_unit, now.comparison
    pair = f"{format_gains(now.winner.gains)} against the first flight's {format_gains(now.baseline.gains)}"
    if comparison.confidence is None or comparison.standard_error is None:
        amount = f"{short(abs(comparison.difference))} {unit}"
        return f"Not known yet: {pair}, {amount} {_direction(comparison)}. {SCATTER_NOT_KNOWN}"
    amount = plus_minus(abs(comparison.difference), comparison.standard_error, unit)
    if comparison.verdict == "unresolved":
        return (
            f"Unresolved: {pair}, {amount} {_direction(comparison)}, {confidence_text(comparison.confidence)} "
            f"confidence. {_deciding(comparison)}"
        )
    return (
        f"{comparison.verdict.capitalize()} with {confidence_text(comparison.confidence)} confidence: {pair}, {amount} "
        f"{_direction(comparison)}."
    )


def _confirm_baseline(
    definition: Definition, experiment: Experiment, now: ComparisonState, left: int, proposal: Proposal
) -> Confirmation:
    if left > 0 and _is_worth_a_step(definition, now, left, proposal):
        return Confirmation(phase="step", why=_describe_improvement(definition, experiment, now, left, proposal))
    tried = len(now.groups) - 1
    found = _NONE_BETTER.get(tried, f"None of the other {tried} gain sets flown is better.")
    obstacle = "" if left <= 0 else _no_prospect(definition, experiment, now, left, proposal)
    return Confirmation(phase="decided", why=f"{verdict_sentence(experiment, now)} {found} {obstacle}".strip())


def _flown_again(experiment: Experiment, now: ComparisonState) -> Confirmation:
    comparison = now.comparison
    assert comparison is not None
    sentence = verdict_sentence(experiment, now)
    if now.looks and comparison.verdict != "unresolved":
        return Confirmation(phase="decided", why=sentence)
    if now.winner.size <= now.baseline.size:
        why = f"The best gains are flown again{_only_once(now) or ', to show whether they are better than the first'}."
        return Confirmation(phase="repeat", why=f"{why}{_missing(comparison)}")
    why = (
        f"The first flight's gains are flown again: they were flown {times(now.baseline.size)}, the best gains "
        f"{times(now.winner.size)}. Otherwise a change in the vehicle could be mistaken for better gains."
    )
    return Confirmation(phase="baseline", why=f"{why}{_missing(comparison)}")


def _only_once(now: ComparisonState) -> str:
    """Why a difference that looks certain is flown again while no gains were repeated."""
    if any(group.size > 1 for group in now.groups):
        is_resolved = now.comparison is not None and now.comparison.verdict != "unresolved"
        return ", because they have only one valid flight" if now.winner.size == 1 and is_resolved else ""
    assumed = ", and the confidence assumes a prior estimate of the scatter" if now.scatter.known else ""
    return f", because no gain set has two valid flights{assumed}"


def _obstacle_to_step(
    definition: Definition, experiment: Experiment, now: ComparisonState, left: int, proposal: Proposal
) -> str:
    """Why no step is flown before the winner is compared with the baseline; empty if one is."""
    if not _is_worth_a_step(definition, now, left, proposal):
        return _no_prospect(definition, experiment, now, left, proposal)
    if now.winner.size > 1:
        return f"{NO_STEP} steps end with the first repeat of the best gains."
    if left <= _CONFIRMATION_FLIGHTS:
        return f"{NO_STEP} the last {_CONFIRMATION_FLIGHTS} flights are reserved for the best and the first gains."
    return ""


def _no_prospect(
    definition: Definition, experiment: Experiment, now: ComparisonState, left: int, proposal: Proposal
) -> str:
    if proposal.kind == "none":
        return f"{NO_STEP} the strategy proposes none."
    return f"{NO_STEP} it {_lack(definition, experiment, now, left, proposal)}"


def _lack(definition: Definition, experiment: Experiment, now: ComparisonState, left: int, proposal: Proposal) -> str:
    """How little a step that is not worth a flight would gain, as the end of a sentence."""
    improvement, unit = _predicted_improvement(now, proposal), experiment.error_unit
    if improvement <= 0.0:
        return "is not predicted to reduce the error."
    return (
        f"would reduce the error by {short(improvement)} {unit}, less than the "
        f"{short(_detectable_difference(definition, now, left))} {unit} that {count(left, 'flight')} can resolve."
    )


def _is_worth_a_step(definition: Definition, now: ComparisonState, left: int, proposal: Proposal) -> bool:
    if proposal.kind == "manual":
        return True
    return proposal.kind != "none" and _predicted_improvement(now, proposal) >= _detectable_difference(
        definition, now, left
    )


def _predicted_improvement(now: ComparisonState, proposal: Proposal) -> float:
    return 0.0 if proposal.predicted_error is None else now.winner.mean - proposal.predicted_error


def _detectable_difference(definition: Definition, now: ComparisonState, left: int) -> float:
    return smallest_difference(now.scatter, now.winner.size, left, definition.stop.confidence)


def _describe_improvement(
    definition: Definition, experiment: Experiment, now: ComparisonState, left: int, proposal: Proposal
) -> str:
    """Predicted improvement of a step that is flown, and what the remaining flights can resolve; empty for a `manual`
    proposal."""
    if proposal.kind == "manual":
        return ""
    unit = experiment.error_unit
    return (
        f"The next step is predicted to reduce the error by {short(_predicted_improvement(now, proposal))} {unit}, "
        f"more than the {short(_detectable_difference(definition, now, left))} {unit} that {count(left, 'flight')} can "
        f"resolve at {percent(definition.stop.confidence)} confidence."
    )


def _direction(comparison: Comparison) -> str:
    return "lower" if comparison.difference < 0.0 else "higher"


def _missing(comparison: Comparison) -> str:
    """What a comparison without a result still needs, as a further sentence."""
    if comparison.confidence is None:
        return f" {SCATTER_NOT_KNOWN}"
    return f" Unresolved so far. {_deciding(comparison)}" if comparison.verdict == "unresolved" else ""


def _shares(further: FlightsToDecide) -> str:
    shares = ((further.first, "with the best gains"), (further.second, "with the first gains"))
    return ", ".join(f"{flights} {whose}" for flights, whose in shares if flights)


def _deciding(comparison: Comparison) -> str:
    if comparison.further is None:
        return "Even 100 more flights would not resolve it."
    return (
        f"If the difference persists, {count(comparison.further.total, 'more flight')} would resolve it: "
        f"{_shares(comparison.further)}."
    )
