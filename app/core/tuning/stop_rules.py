"""Stop rules: when a campaign ends automatically.

Under the rule `noise` the proposals schedule the flights that decide whether further steps can be distinguished from
noise, and whether the winner is better than the first gains. There are two phases. *Steps* are worth flying while the
predicted improvement is at least what the remaining flights could distinguish from noise. After that, the winner and
the baseline (the first flight's gains) are flown again in turn until the difference is decided. The confidence allows
for the number of policies from which the winner was chosen, and for every repeated comparison. Gains outside the
campaign's bounds, flown by overruling a refusal, would be refused again and are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

from app.core.definition import Flight, StopRule, aborted_by_gains
from app.core.experiments.base import Experiment
from app.core.formatting import (
    confidence_text,
    count,
    direction_of,
    format_gains,
    named_flights,
    percent,
    plus_minus,
    short,
    times,
)
from app.core.records.trajectory import Trajectory
from app.core.statistics.comparisons import (
    SCATTER_NOT_KNOWN,
    Comparison,
    deciding_flights,
    smallest_difference,
    undecided,
)
from app.core.tuning.evidence import Evidence
from app.core.tuning.strategy import Kind, Proposal

Reason = Literal["aborted again", "not improving", "flight budget", "nothing better", "told from noise", "battery low"]

FAILURES_ALLOWED: Final = 2
ABORTS_ALLOWED: Final = 2
"""Flights with the same gains that may be aborted because of them."""
TUNE_FIRST: Final = (
    "Often another loop is the cause: oscillating rate loops make a vehicle climb, drift or lean with any gains of "
    "this campaign. Look at its attitude in the flight, and tune attitude first"
)
"""What it may mean that a limit aborted a flight, without a full stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StopVerdict:
    """Whether to stop, and why.

    `why` is a sentence in both cases. `failures` counts the scored flights in a row, up to the last, without enough
    improvement; `threshold` is the error that the next flight must stay below to count as an improvement.
    """

    stop: bool
    reason: Reason | None
    why: str
    failures: int
    threshold: float | None


def evaluate_stop_rule(
    evidence: Evidence[Experiment], proposal: Proposal, *, battery_v: float | None = None
) -> StopVerdict:
    """Apply the campaign's stop rule to its flights and the proposal computed from them.

    With any rule, gains are not proposed once more after `ABORTS_ALLOWED` flights were aborted because of them. Flights
    that repeat earlier gains count towards the budget only: they are not expected to improve. `battery_v` is the
    voltage, V, at which the last flight ended, whether or not that flight counts. In a reopened campaign a low battery
    is still reported.
    """
    flights, open_until_flight = evidence.flights, evidence.open_until_flight
    verdict = decide_stop(
        evidence.definition.stop,
        [None if _is_repeat(flights, place) else flight.error for place, flight in enumerate(flights)],
        proposal.kind,
        battery_v=battery_v,
        because=proposal.explanation.summary,
        open_until_flight=open_until_flight,
    )
    aborted = [] if proposal.kind in ("none", "manual") else aborted_by_gains(flights, proposal.gains)
    if len(aborted) >= ABORTS_ALLOWED:
        why = (
            f"{named_flights([flight.number for flight in aborted]).capitalize()} were aborted because of the "
            f"vehicle's behaviour with the same gains ({format_gains(proposal.gains)}). {TUNE_FIRST}, then start a new "
            "campaign; or reopen this one for custom gains."
        )
        verdict = replace(verdict, stop=True, reason="aborted again", why=why)
    if not verdict.stop or len(flights) >= open_until_flight:
        return verdict
    left = count(open_until_flight - len(flights), "more flight")
    warning = f" {verdict.why}" if verdict.reason == "battery low" else ""
    return replace(verdict, stop=False, reason=None, why=f"Reopened for {left}.{warning}")


def describe_budget(max_flights: int, open_until_flight: int) -> str:
    """`3 flights`; of a campaign that was reopened beyond them `3 flights and 1 more after reopening`."""
    further = open_until_flight - max_flights
    return count(max_flights, "flight") + (f" and {further} more after reopening" if further > 0 else "")


def _is_repeat(flights: Sequence[Flight], place: int) -> bool:
    """Whether its gains have been scored before."""
    return any(earlier.error is not None and earlier.gains == flights[place].gains for earlier in flights[:place])


def battery_v(record: Trajectory, sample: int) -> float | None:
    """Battery voltage in the first sample, 0, or the last, -1, of a flight, V; None if not recorded."""
    recorded = record.channels.get("battery_v")
    return float(recorded[sample]) if recorded is not None and len(recorded) else None


def decide_stop(
    rule: StopRule,
    errors: Sequence[float | None],
    proposal_kind: Kind | None = None,
    *,
    battery_v: float | None = None,
    because: str = "",
    open_until_flight: int = 0,
) -> StopVerdict:
    """Apply a stop rule to the errors of the flights so far, in order.

    None stands for a flight without an error (aborted) or with gains flown before: it counts towards the budget, but
    not as an improvement or a failure. `battery_v` is the voltage at which the last flight ended. `open_until_flight`,
    the number of flights for which the campaign was reopened, is only named with its budget.

    `paper` is the paper's rule: stop when the error fails twice in a row to improve by more than 5 % on the
    best so far, or after 7 flights; also when the line search finds nothing better (its step 7). The first error is
    neither an improvement on anything nor a failure. `noise` never stops on errors: the proposals schedule the flights
    that decide, and kind `none` ends the campaign, with `because` (its explanation) as the reason. `budget` counts
    flights only.
    """
    best: float | None = None
    failures = 0
    for error in errors:
        if error is None:
            continue
        improves = best is None or error < (1.0 - rule.improvement) * best
        failures = 0 if improves else failures + 1
        best = error if best is None else min(error, best)
    ended = _ended(rule, len(errors), failures, proposal_kind, battery_v, open_until_flight)
    reason, sentence = ended or (None, "")
    if reason is not None:
        why = f"{sentence} {because if rule.kind == 'noise' else ''}".strip()
    elif rule.kind == "paper" and failures:
        why = (
            f"The last flight did not improve on the best before it by more than {percent(rule.improvement)}; one more "
            "such flight ends the campaign."
        )
    else:
        left = rule.max_flights - len(errors)
        why = f"{left} of {rule.max_flights} flights {'is' if left == 1 else 'are'} left."
    return StopVerdict(
        stop=reason is not None,
        reason=reason,
        why=why,
        failures=failures,
        threshold=None if best is None or rule.kind == "noise" else (1.0 - rule.improvement) * best,
    )


def _ended(
    rule: StopRule,
    flights: int,
    failures: int,
    proposal_kind: Kind | None,
    battery_v: float | None,
    open_until_flight: int,
) -> tuple[Reason, str] | None:
    """Why the campaign ends, as a sentence too; None if it goes on."""
    if rule.kind == "noise" and proposal_kind == "none" and flights < rule.max_flights:
        return "told from noise", ""
    if flights >= rule.max_flights:
        is_plain = rule.max_flights > 1 and rule.max_flights >= open_until_flight
        budget = describe_budget(rule.max_flights, open_until_flight)
        every = f"All {rule.max_flights} flights of the budget have been flown."
        return "flight budget", every if is_plain else f"The budget of {budget} has been flown."
    if rule.kind == "paper" and failures >= FAILURES_ALLOWED:
        by = f"more than {percent(rule.improvement)}"
        why = f"The last {failures} consecutive flights did not improve on the best before them by {by}."
        return "not improving", why
    if rule.kind == "paper" and proposal_kind == "none":
        return "nothing better", "The model predicts no improvement over the best flight."
    if rule.min_battery_v is not None and battery_v is not None and battery_v < rule.min_battery_v:
        return "battery low", f"The last flight ended at {battery_v:.2f} V; the minimum is {rule.min_battery_v} V."
    return None


_NONE_BETTER: Final = {0: "No other gains were flown.", 1: "The other gain set flown is not better."}

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
    found = _Prospect(evidence, proposal).next()
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
    step = _Prospect(evidence, proposal)
    return step.described if step.is_worth_a_flight else f"This step {step.lack}"


@dataclass(frozen=True, slots=True)
class _Prospect:
    """A proposed step, beside what the flights that are left can distinguish from noise; `now` is the evidence of the
    gains inside the bounds."""

    evidence: Evidence[Experiment]
    proposal: Proposal

    @property
    def now(self) -> Evidence[Experiment]:
        return self.evidence.within_bounds

    @property
    def _improvement(self) -> float:
        """Predicted improvement of the step."""
        error = self.proposal.predicted_error
        return 0.0 if error is None else self.now.winner.mean - error

    @property
    def _resolvable(self) -> float:
        return smallest_difference(
            self.now.scatter, self.now.winner.size, self.evidence.left, self.now.definition.stop.confidence
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
            f"{short(self._resolvable)} {unit} that {count(self.evidence.left, 'flight')} can resolve at "
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
            f"{unit} that {count(self.evidence.left, 'flight')} can resolve."
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
        if self.evidence.left <= _CONFIRMATION_FLIGHTS:
            return f"{_NO_STEP} the last {_CONFIRMATION_FLIGHTS} flights are reserved for the best and the first gains."
        return ""

    def next(self) -> Confirmation:
        """What to fly next."""
        now, left = self.now, self.evidence.left
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
