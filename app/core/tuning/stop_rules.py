"""Stop rules: when a campaign ends automatically."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

from app.core.definition import Flight, StopRule, aborted_by_gains
from app.core.experiments.base import Experiment
from app.core.formatting import count, format_gains, named_flights, percent
from app.core.records.trajectory import Trajectory
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


def landing_battery_v(record: Trajectory) -> float | None:
    """Battery voltage at the end of a flight, V; None if not recorded."""
    return _battery_v(record, -1)


def starting_battery_v(record: Trajectory) -> float | None:
    """Battery voltage at the start of a flight, V; None if not recorded."""
    return _battery_v(record, 0)


def _battery_v(record: Trajectory, sample: int) -> float | None:
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
