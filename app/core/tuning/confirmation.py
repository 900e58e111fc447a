"""Decides whether further steps can be distinguished from noise, and whether the winner is better than the first gains.

There are two phases. *Steps* are worth flying while the predicted improvement is at least what the remaining flights
could distinguish from noise. After that, the winner and the baseline (the first flight's gains) are flown again in turn
until the difference is decided. The confidence allows for the number of policies from which the winner was chosen, and
for every repeated comparison. Gains outside the campaign's bounds, flown by overruling a refusal, would be refused
again and are left out.
"""

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final, Literal

from app.core.experiments.base import Experiment
from app.core.formatting import confidence_text, count, direction_of, format_gains, percent, plus_minus, short, times
from app.core.statistics.comparisons import (
    SCATTER_NOT_KNOWN,
    Comparison,
    deciding_flights,
    smallest_difference,
    undecided,
)
from app.core.tuning.evidence import Evidence
from app.core.tuning.strategy import Proposal

_NONE_BETTER: Final = MappingProxyType({0: "No other gains were flown.", 1: "The other gain set flown is not better."})

_NO_STEP: Final = "No further step is flown:"

_CONFIRMATION_FLIGHTS: Final = 2
"""Flights reserved for repeating the winner and the baseline."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """What to fly next: the strategy's step, the winner again, the baseline again, or nothing more, and why."""

    phase: Literal["step", "repeat", "baseline", "decided"]
    why: str


def confirm(evidence: Evidence[Experiment], proposal: Proposal) -> Confirmation:
    """Choose the next flight under the stop rule `noise`. At least one valid flight must lie inside the bounds.

    A proposal of kind `manual` predicts no improvement and counts as worth a flight until the flights run short.
    """
    found = _prospect(evidence, proposal).next()
    return replace(found, why=f"{found.why} {_left_out(evidence)}".strip())


def _left_out(evidence: Evidence[Experiment]) -> str:
    within = {flight.number for flight in evidence.within_bounds.flights}
    out = [str(flight.number) for flight in evidence.flights if flight.number not in within]
    if not out:
        return ""
    do = ("Flight", "lies", "is") if len(out) == 1 else ("Flights", "lie", "are")
    return f"{do[0]} {', '.join(out)} {do[1]} outside the bounds and {do[2]} not compared."


def describe_step(evidence: Evidence[Experiment], proposal: Proposal) -> str:
    """Predicted improvement of a step beside what the remaining flights, at least one, can distinguish from noise;
    empty for a `manual` proposal."""
    step = _prospect(evidence, proposal)
    return step.described if step.is_worth_a_flight else f"This step {step.lack}"


@dataclass(frozen=True, slots=True)
class _Prospect:
    """A proposed step, beside what the flights that are `left` can distinguish from noise; `now` is the evidence of the
    gains inside the bounds."""

    now: Evidence[Experiment]
    left: int
    proposal: Proposal

    @property
    def _improvement(self) -> float:
        """Predicted improvement of the step."""
        error = self.proposal.predicted_error
        return 0.0 if error is None else self.now.winner.mean - error

    @property
    def _resolvable(self) -> float:
        return smallest_difference(
            self.now.scatter, self.now.winner.size, self.left, self.now.definition.stop.confidence
        )

    @property
    def is_worth_a_flight(self) -> bool:
        if self.proposal.kind == "manual":
            return True
        return self.proposal.kind != "none" and self._improvement >= self._resolvable

    @property
    def described(self) -> str:
        """Predicted improvement of a step that is flown, and what the remaining flights can resolve; empty for a
        `manual` proposal."""
        if self.proposal.kind == "manual":
            return ""
        unit = self.now.experiment.error_unit
        return (
            f"The next step is predicted to reduce the error by {short(self._improvement)} {unit}, more than the "
            f"{short(self._resolvable)} {unit} that {count(self.left, 'flight')} can resolve at "
            f"{percent(self.now.definition.stop.confidence)} confidence."
        )

    @property
    def lack(self) -> str:
        """How little a step that is not worth a flight would gain, as the end of a sentence."""
        if self._improvement <= 0.0:
            return "is not predicted to reduce the error."
        unit = self.now.experiment.error_unit
        return (
            f"would reduce the error by {short(self._improvement)} {unit}, less than the {short(self._resolvable)} "
            f"{unit} that {count(self.left, 'flight')} can resolve."
        )

    @property
    def _why_none(self) -> str:
        return f"{_NO_STEP} {'the strategy proposes none.' if self.proposal.kind == 'none' else f'it {self.lack}'}"

    @property
    def _obstacle(self) -> str:
        """Why no step is flown before the winner is compared with the baseline; empty if one is."""
        if not self.is_worth_a_flight:
            return self._why_none
        if self.now.winner.size > 1:
            return f"{_NO_STEP} steps end with the first repeat of the best gains."
        if self.left <= _CONFIRMATION_FLIGHTS:
            return f"{_NO_STEP} the last {_CONFIRMATION_FLIGHTS} flights are reserved for the best and the first gains."
        return ""

    def next(self) -> Confirmation:
        """What to fly next."""
        now, left = self.now, self.left
        is_baseline = now.winner is now.baseline
        if left > 0 and (self.is_worth_a_flight if is_baseline else not self._obstacle):
            return Confirmation(phase="step", why=self.described)
        sentence = verdict_sentence(now)
        if is_baseline:
            tried = len(now.groups) - 1
            found = _NONE_BETTER.get(tried, f"None of the other {tried} gain sets flown is better.")
            return Confirmation(phase="decided", why=f"{sentence} {found} {self._why_none if left > 0 else ''}".strip())
        if left <= 0:
            return Confirmation(phase="decided", why=sentence)
        again = _flown_again(now, sentence)
        return replace(again, why=f"{again.why} {self._obstacle}")


def _prospect(evidence: Evidence[Experiment], proposal: Proposal) -> _Prospect:
    return _Prospect(evidence.within_bounds, evidence.left, proposal)


def verdict_sentence(now: Evidence[Experiment]) -> str:
    """The winner compared with the first gains, in a sentence."""
    comparison, unit = now.comparison, now.experiment.error_unit
    if comparison is None:
        return f"The first flight's gains ({format_gains(now.baseline.gains)}) are the best flown."
    pair = f"{format_gains(now.winner.gains)} against the first flight's {format_gains(now.baseline.gains)}"
    apart, error = abs(comparison.difference), comparison.standard_error
    amount = f"{short(apart)} {unit}" if error is None else plus_minus(apart, error, unit)
    found = f"{pair}, {amount} {direction_of(comparison.difference)}"
    if comparison.verdict in ("unresolved", "not known yet"):
        return undecided(comparison, found, _deciding(comparison))
    return (
        f"{comparison.verdict.capitalize()} with {confidence_text(comparison.confidence or 0.0)} confidence: {found}."
    )


def _flown_again(now: Evidence[Experiment], verdict: str) -> Confirmation:
    comparison = now.comparison
    assert comparison is not None
    if now.looks and comparison.verdict != "unresolved":
        return Confirmation(phase="decided", why=verdict)
    if now.winner.size <= now.baseline.size:
        why = f"The best gains are flown again{_only_once(now) or ', to show whether they are better than the first'}."
        return Confirmation(phase="repeat", why=f"{why}{_missing(comparison)}")
    why = (
        f"The first flight's gains are flown again: they were flown {times(now.baseline.size)}, the best gains "
        f"{times(now.winner.size)}. Otherwise a change in the vehicle could be mistaken for better gains."
    )
    return Confirmation(phase="baseline", why=f"{why}{_missing(comparison)}")


def _only_once(now: Evidence[Experiment]) -> str:
    """Why a difference that looks certain is flown again while no gains were repeated."""
    if any(group.size > 1 for group in now.groups):
        is_resolved = now.comparison is not None and now.comparison.verdict != "unresolved"
        return ", because they have only one valid flight" if now.winner.size == 1 and is_resolved else ""
    assumed = ", and the confidence assumes a prior estimate of the scatter" if now.scatter.known else ""
    return f", because no gain set has two valid flights{assumed}"


def _missing(comparison: Comparison) -> str:
    """What a comparison without a result still needs, as a further sentence."""
    if comparison.confidence is None:
        return f" {SCATTER_NOT_KNOWN}"
    return f" Unresolved so far. {_deciding(comparison)}" if comparison.verdict == "unresolved" else ""


def _deciding(comparison: Comparison) -> str:
    return deciding_flights(comparison, "with the best gains", "with the first gains")
