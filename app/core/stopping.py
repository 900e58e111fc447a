"""When a campaign ends by itself."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from app.core.definition import StopRule
from app.core.strategies.base import Kind

Reason = Literal["not improving", "flight budget", "nothing better on the line"]

FAILURES_ALLOWED: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class StopVerdict:
    """Whether to stop and why. `why` is a sentence in both cases; `failures` counts the scored flights in a row, up to
    the last, without enough improvement; `threshold` is the error the next flight must stay below to count as one."""

    stop: bool
    reason: Reason | None
    why: str
    failures: int
    threshold: float | None


def verdict(rule: StopRule, errors: Sequence[float | None], proposal_kind: Kind | None = None) -> StopVerdict:
    """Judge the flights so far, in their order; None stands for a flight without an error (aborted): it uses up
    budget, and says nothing about improvement.

    The paper's rule, literally: stop when the error fails twice in a row to improve by more than 5 % on the best so
    far, or after 7 flights; also when the line search finds nothing better (its step 7). The first error improves on
    nothing and fails nothing. `budget` counts flights only.
    """
    best: float | None = None
    failures = 0
    for error in errors:
        if error is None:
            continue
        improves = best is None or error < (1.0 - rule.improvement) * best
        failures = 0 if improves else failures + 1
        best = error if best is None else min(error, best)
    threshold = None if best is None else (1.0 - rule.improvement) * best
    reason = _reason(rule, len(errors), failures, proposal_kind)
    return StopVerdict(
        stop=reason is not None,
        reason=reason,
        why=_sentence(rule, reason, len(errors), failures),
        failures=failures,
        threshold=threshold,
    )


def _reason(rule: StopRule, flights: int, failures: int, proposal_kind: Kind | None) -> Reason | None:
    if flights >= rule.max_flights:
        return "flight budget"
    if rule.kind == "paper" and failures >= FAILURES_ALLOWED:
        return "not improving"
    if rule.kind == "paper" and proposal_kind == "none":
        return "nothing better on the line"
    return None


def _sentence(rule: StopRule, reason: Reason | None, flights: int, failures: int) -> str:
    by = f"more than {rule.improvement:.0%}"
    match reason:
        case "flight budget":
            return f"All {rule.max_flights} flights of the budget are flown."
        case "not improving":
            return f"The last {failures} flights in a row did not improve by {by} on the best before them."
        case "nothing better on the line":
            return "The corrected model finds nothing better along the line from the best flight."
        case None if rule.kind == "paper" and failures:
            return f"The last flight did not improve by {by} on the best before it; one more such flight ends it."
        case None:
            return f"{rule.max_flights - flights} of {rule.max_flights} flights are left."
