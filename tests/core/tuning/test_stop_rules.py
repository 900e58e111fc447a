from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from app.core.definition import Definition, Flight, StopRule
from app.core.experiments.base import Experiment
from app.core.tuning.evidence import Evidence
from app.core.tuning.stop_rules import battery_v, decide_stop, evaluate_stop_rule
from app.core.tuning.strategy import Explanation, Proposal
from tests.core.tuning.bowl import QuadraticExperiment, fly
from tests.core.tuning.defined import evidence

PAPER = StopRule(kind="paper")


def known(definition: Definition, flights: Sequence[Flight], open_until_flight: int = 0) -> Evidence[Experiment]:
    return evidence(definition, QuadraticExperiment(), flights, open_until_flight=open_until_flight)


@pytest.mark.parametrize(
    ("errors", "stop", "reason"),
    [
        ([], False, None),
        ([0.3775], False, None),
        ([0.3775, 0.2006, 0.1596, 0.1733], False, None),  # Table 1, left: run 5 was flown …
        ([0.3775, 0.2006, 0.1596, 0.1733, 0.1521], True, "not improving"),  # … and improved by 4.7 % only
        ([0.5102, 0.2537, 0.2265, 0.2652, 0.2483], True, "not improving"),  # Table 2, left
        ([0.1006, 0.0966], False, None),
        ([0.1006, 0.0966, 0.0940], True, "not improving"),  # Table 1, right, literally; the paper flew one more
        ([0.1218, 0.1249, 0.1278], True, "not improving"),  # Table 2, right
        ([0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01], True, "flight budget"),
    ],
)
def test_the_papers_rule_on_the_papers_series(errors: list[float], stop: bool, reason: str | None) -> None:
    judged = decide_stop(PAPER, errors)
    assert (judged.stop, judged.reason) == (stop, reason)


def test_an_improvement_of_exactly_the_fraction_is_not_more_than_it() -> None:
    rule = StopRule(kind="paper", improvement=0.5)
    assert decide_stop(rule, [0.5, 0.25]).failures == 1
    assert decide_stop(rule, [0.5, 0.2499]).failures == 0


def test_small_gains_that_add_up_do_not_count() -> None:
    """Each flight is held against the best so far, not against the last that counted."""
    assert decide_stop(PAPER, [1.0, 0.96, 0.93]).stop


def test_one_success_between_failures_resets_the_count() -> None:
    judged = decide_stop(PAPER, [1.0, 1.1, 0.9, 1.2])
    assert (judged.stop, judged.failures) == (False, 1)
    assert judged.threshold == pytest.approx(0.855)
    assert "one more such flight" in judged.why


def test_an_aborted_flight_neither_improves_nor_fails_but_uses_up_budget() -> None:
    assert decide_stop(PAPER, [0.5, None, None]).reason is None
    assert decide_stop(PAPER, [0.5, 0.49, None, 0.48]).reason == "not improving"
    assert decide_stop(PAPER, [None, 0.5]).failures == 0
    assert decide_stop(PAPER, [None]).threshold is None
    assert decide_stop(PAPER, [None] * 7).reason == "flight budget"


def test_gains_that_were_aborted_twice_are_not_proposed_a_third_time_whatever_they_flew_before() -> None:
    valid = fly(1, 2.0, 1.0)
    again = replace(valid, number=2, outcome="aborted", error=None)
    other = replace(again, gains={"a": 1.0, "b": 1.0})
    repeat = Proposal(
        kind="repeat",
        gains=dict(valid.gains),
        predicted=None,
        predicted_error=None,
        explanation=Explanation(summary=""),
    )

    def reason(*flights: Flight, proposal: Proposal = repeat, open_until_flight: int = 0) -> str | None:
        definition = Definition(stop=StopRule(kind="noise"))
        return evaluate_stop_rule(known(definition, flights, open_until_flight=open_until_flight), proposal).reason

    assert reason(valid, again) is None
    assert reason(valid, again, other) is None
    assert reason(valid, again, replace(again, against_gains=False)) is None
    assert reason(valid, again, replace(again, number=3)) == "aborted again"
    assert reason(valid, again, replace(again, number=3), open_until_flight=4) is None
    manual = replace(repeat, kind="manual")
    assert reason(valid, again, replace(again, number=3), proposal=manual) is None


def test_a_line_without_anything_better_ends_the_paper_rule_only() -> None:
    assert decide_stop(PAPER, [0.5], "none").reason == "nothing better"
    assert decide_stop(PAPER, [0.5], "manual").reason is None
    assert decide_stop(StopRule(kind="budget"), [0.5], "none").reason is None


def test_the_budget_rule_counts_flights_only() -> None:
    rule = StopRule(kind="budget", max_flights=4)
    assert not decide_stop(rule, [0.5, 0.5, 0.5]).stop
    assert decide_stop(rule, [0.5, 0.5, 0.5]).why == "1 of 4 flights is left."
    assert decide_stop(rule, [0.5] * 4).reason == "flight budget"
    assert "All 4 flights" in decide_stop(rule, [0.5] * 4).why


def test_the_noise_rule_never_stops_on_errors_but_when_nothing_is_left_to_tell() -> None:
    rule = StopRule(kind="noise", max_flights=4)
    same = [0.5, 0.5, 0.5]
    assert decide_stop(rule, same, "step").reason is None
    assert decide_stop(rule, same, "step").threshold is None
    judged = decide_stop(rule, same, "none", because="Better.")
    assert (judged.reason, judged.why) == ("told from noise", "Better.")
    spent = decide_stop(rule, [*same, 0.5], "none", because="Unresolved.")
    assert (spent.reason, spent.why) == ("flight budget", "All 4 flights of the budget have been flown. Unresolved.")


def test_a_budget_of_one_flight_is_said_in_the_singular() -> None:
    spent = decide_stop(StopRule(kind="budget", max_flights=1), [0.5])
    assert spent.why == "The budget of 1 flight has been flown."


@pytest.mark.parametrize("kind", ["paper", "noise", "budget"])
def test_a_low_battery_ends_a_campaign_under_every_rule(kind: Literal["paper", "noise", "budget"]) -> None:
    rule = StopRule(kind=kind, min_battery_v=10.5)
    assert decide_stop(rule, [0.5], "step", battery_v=10.5).reason is None
    assert decide_stop(rule, [0.5], "step").reason is None
    low = decide_stop(rule, [0.5], "step", battery_v=10.42, because="A step.")
    assert low.reason == "battery low"
    assert low.why.startswith("The last flight ended at 10.42 V; the minimum is 10.5 V.")


def test_the_battery_is_read_at_both_ends_of_a_record() -> None:
    flight = fly(1, 30, 40)
    assert (battery_v(flight.trajectory, 0), battery_v(flight.trajectory, -1)) == (None, None)
    channels = {**flight.trajectory.channels, "battery_v": np.linspace(11.1, 10.4, len(flight.trajectory))}
    recorded = replace(flight.trajectory, channels=channels)
    assert battery_v(recorded, 0) == pytest.approx(11.1)
    assert battery_v(recorded, -1) == pytest.approx(10.4)


STEP = Proposal(kind="step", gains={}, predicted=None, predicted_error=None, explanation=Explanation(summary="A step."))


def test_repeats_and_baselines_are_no_failures_to_improve() -> None:
    """Seen: “the last 2 flights did not improve” after the two repeats that the program itself had asked for."""
    flights = [fly(1, 90, 90), fly(2, 30, 40), fly(3, 30, 40), fly(4, 90, 90)]
    definition = Definition(stop=StopRule(kind="paper", max_flights=9))
    assert evaluate_stop_rule(known(definition, flights), STEP).failures == 0
    worse = [*flights, fly(5, 50, 50), fly(6, 50, 50)]
    assert evaluate_stop_rule(known(definition, worse), STEP).failures == 1
    assert evaluate_stop_rule(known(definition, [*worse, fly(7, 60, 50)]), STEP).reason == "not improving"


def test_gains_that_were_only_aborted_before_are_no_repeat() -> None:
    aborted = replace(fly(1, 30, 40), outcome="aborted", error=None)
    flights = [aborted, fly(2, 30, 40)]
    verdict = evaluate_stop_rule(known(Definition(stop=StopRule(kind="paper", improvement=0.5)), flights), STEP)
    assert verdict.threshold == pytest.approx(0.5 * (flights[1].error or 0.0))


def test_a_reopened_campaign_is_still_warned_of_a_low_battery() -> None:
    definition = Definition(stop=StopRule(kind="paper", min_battery_v=10.5))
    verdict = evaluate_stop_rule(known(definition, [fly(1, 30, 40)], open_until_flight=4), STEP, battery_v=10.2)
    assert not verdict.stop
    assert verdict.why.startswith(
        "Reopened for 3 more flights. The last flight ended at 10.20 V; the minimum is 10.5 V."
    )


@pytest.mark.parametrize("flown", [2, 3])
def test_no_rule_ends_a_campaign_before_the_flights_it_was_reopened_for(flown: int) -> None:
    flights = [fly(number, 30, 40) for number in range(1, flown + 1)]
    definition = Definition(stop=StopRule(kind="budget", max_flights=1))
    verdict = evaluate_stop_rule(known(definition, flights, open_until_flight=3), STEP)
    assert (verdict.stop, verdict.reason) == ((False, None) if flown < 3 else (True, "flight budget"))
    assert verdict.why == (
        "Reopened for 1 more flight."
        if flown < 3
        else "The budget of 1 flight and 2 more after reopening has been flown."
    )


def test_a_low_battery_ends_a_campaign_also_when_no_flight_counts() -> None:
    proposal = STEP
    definition = Definition(stop=StopRule(kind="paper", min_battery_v=10.5))
    for flights in ([], [fly(1, 30, 40)]):
        assert evaluate_stop_rule(known(definition, flights), proposal).reason is None
        assert evaluate_stop_rule(known(definition, flights), proposal, battery_v=10.6).reason is None
        assert evaluate_stop_rule(known(definition, flights), proposal, battery_v=10.4).reason == "battery low"
