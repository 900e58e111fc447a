"""Telling the winner from luck: the rule `noise`, and advice under the other rules."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from app.core.definition import Definition, Flight, StopRule
from app.core.experiments.base import Experiment
from app.core.tuning.evidence import Evidence
from app.core.tuning.proposals import Advice, advise
from app.core.tuning.stop_rules import confirm, evaluate_stop_rule, verdict_sentence
from app.core.tuning.strategy import Explanation, Kind, Proposal
from tests.core.tuning.bowl import QuadraticExperiment, fly
from tests.core.tuning.defined import evidence

NOISE = Definition(stop=StopRule(kind="noise", max_flights=12))
PAPER = Definition(stop=StopRule(kind="paper", max_flights=12))
SIGMA = QuadraticExperiment.scatter.sd


def flown(*runs: tuple[float, float]) -> list[Flight]:
    """Flights by gain `a` and error."""
    return [
        Flight(
            number=number,
            gains={"a": a, "b": 40},
            trajectory=fly(number, a, 40).trajectory,
            error=error,
            outcome="valid",
        )
        for number, (a, error) in enumerate(runs, start=1)
    ]


def proposed(kind: Kind = "step", error: float | None = 0.1, a: float = 99.0) -> Proposal:
    return Proposal(
        kind=kind,
        gains={"a": a, "b": 40},
        predicted=None,
        predicted_error=error,
        explanation=Explanation(summary="As the strategy has it."),
    )


def known(definition: Definition, flights: Sequence[Flight], open_until_flight: int = 0) -> Evidence[Experiment]:
    return evidence(definition, QuadraticExperiment(), flights, open_until_flight=open_until_flight)


def advised(evidence: Evidence[Experiment], proposal: Proposal) -> Advice:
    return advise(evidence, proposal, evaluate_stop_rule(evidence, proposal))


def phase(flights: list[Flight], proposal: Proposal, definition: Definition = NOISE) -> str:
    return confirm(known(definition, flights), proposal).phase


def test_a_step_with_a_resolvable_improvement_is_flown() -> None:
    found = confirm(known(NOISE, flown((1, 0.5))), proposed(error=0.3))
    assert found.phase == "step"
    assert "is predicted to reduce the error by 0.200 m, more than the 0.0078 m that 11 flights" in found.why


def test_a_step_without_a_resolvable_improvement_ends_a_campaign_without_a_winner() -> None:
    found = confirm(known(NOISE, flown((1, 0.5))), proposed(error=0.499))
    assert found.phase == "decided"
    assert "would reduce the error by 0.0010 m, less than the 0.0078 m that 11 flights" in found.why
    assert "No other gains were flown." in found.why
    tried = confirm(known(NOISE, flown((1, 0.5), (2, 0.6))), proposed("none", 0.5))
    assert tried.phase == "decided"
    assert "The other gain set flown is not better. No further step is flown: the strategy proposes none." in tried.why


def test_the_winner_and_the_baseline_are_flown_again_in_turn_until_it_is_decided() -> None:
    flights = flown((1, 0.5), (2, 0.2))
    assert phase(flights, proposed("none", 0.2)) == "repeat"
    flights = flown((1, 0.5), (2, 0.2), (2, 0.21))
    assert phase(flights, proposed(error=0.0)) == "baseline"
    flights = flown((1, 0.5), (2, 0.2), (2, 0.21), (1, 0.49))
    found = confirm(known(NOISE, flights), proposed(error=0.0))
    assert found.phase == "decided"
    assert found.why.startswith(
        "Better with more than 99.9\u00a0% confidence: a 2, b 40 against the first flight's a 1, b 40"
    )


def test_an_undecided_comparison_continues_until_the_budget_ends_and_states_what_would_decide() -> None:
    runs = [(1, 0.200), (2, 0.195), (2, 0.197), (1, 0.199)]
    found = confirm(known(NOISE, flown(*runs)), proposed("none"))
    assert found.phase == "repeat"
    assert "Unresolved" in found.why
    assert "would not resolve it" in found.why
    spent = Definition(stop=StopRule(kind="noise", max_flights=4))
    assert phase(flown(*runs), proposed(error=0.0), spent) == "decided"


def test_two_flights_are_kept_back_for_the_confirmation() -> None:
    flights = flown((1, 0.5), (2, 0.3))
    assert phase(flights, proposed(error=0.1), Definition(stop=StopRule(kind="noise", max_flights=5))) == "step"
    assert phase(flights, proposed(error=0.1), Definition(stop=StopRule(kind="noise", max_flights=4))) == "repeat"


def test_the_operators_own_gains_are_no_promise_and_need_none() -> None:
    assert phase(flown((1, 0.5)), proposed("manual", 0.5)) == "step"
    assert phase(flown((1, 0.5), (2, 0.3)), proposed("manual", 0.3)) == "step"
    assert phase(flown((1, 0.5)), proposed("step", None)) == "decided"


@pytest.mark.parametrize(
    ("bounds", "winner", "baseline", "left_out"),
    [
        ((0.0, 100.0), 3.0, 1.0, ""),
        ((1.5, 100.0), 3.0, 2.0, "Flight 1 lies outside the bounds and is not compared."),
        ((0.0, 2.5), 2.0, 1.0, "Flights 3, 4 lie outside the bounds and are not compared."),
        ((3.5, 100.0), 4.0, 4.0, "Flights 1, 2, 3 lie outside the bounds and are not compared."),
    ],
)
def test_only_gains_inside_the_bounds_are_confirmed(
    bounds: tuple[float, float], winner: float, baseline: float, left_out: str
) -> None:
    """Those outside were flown over a refusal and would be refused again."""
    definition = replace(NOISE, bounds={"a": bounds})
    flights = flown((1, 0.5), (2, 0.4), (3, 0.2), (4, 0.3))
    now = known(definition, flights).within_bounds
    assert (now.winner.gains["a"], now.baseline.gains["a"]) == (winner, baseline)
    why = confirm(known(definition, flights), proposed("none", 0.2)).why
    assert why.endswith(left_out)
    assert ("outside the bounds" in why) == bool(left_out)


def test_with_every_flight_outside_the_bounds_nothing_is_confirmed() -> None:
    definition = replace(NOISE, bounds={"a": (50.0, 100.0)})
    assert known(definition, flown((1, 0.5), (2, 0.2))).within_bounds.groups == ()
    advice = advised(known(definition, flown((1, 0.5))), proposed())
    assert (advice.kind, advice.gains["a"]) == ("step", 99.0)


def test_a_difference_that_nothing_would_decide_is_said_to_be_one() -> None:
    now = known(NOISE, flown((1, 0.2), (2, 0.2), (2, 0.1999999)))
    assert now.comparison is not None
    assert "Even 100 more flights would not resolve it" in verdict_sentence(now)


def test_before_the_first_flight_nothing_stands() -> None:
    assert known(NOISE, []).comparison is None


@pytest.mark.complete
def test_equal_policies_are_rarely_called_better() -> None:
    """Three others as good as the first, the luckiest of them confirmed against it: 400 campaigns with the scatter that
    the statistics expect. At most the rule's 10 %."""
    rng = np.random.default_rng(7)
    better = 0
    for _ in range(400):
        runs = [(float(a), 0.2 + SIGMA * rng.standard_normal()) for a in range(4)]
        while (now := phase(flown(*runs), proposed("none"))) in {"repeat", "baseline"}:
            found = known(NOISE, flown(*runs))
            again = found.winner if now == "repeat" else found.baseline
            runs.append((again.gains["a"], 0.2 + SIGMA * rng.standard_normal()))
        last = known(NOISE, flown(*runs))
        better += last.comparison is not None and last.comparison.verdict == "better"
    assert better / 400 <= 0.1


def test_a_real_improvement_of_five_standard_deviations_is_nearly_always_found() -> None:
    rng = np.random.default_rng(8)
    better, flights = 0, 0
    for _ in range(200):
        runs = [(0.0, 0.2 + SIGMA * rng.standard_normal()), (1.0, 0.15 + SIGMA * rng.standard_normal())]
        while (now := phase(flown(*runs), proposed("none"))) in {"repeat", "baseline"}:
            a, true = (1.0, 0.15) if now == "repeat" else (0.0, 0.2)
            runs.append((a, true + SIGMA * rng.standard_normal()))
        last = known(NOISE, flown(*runs))
        better += last.comparison is not None and last.comparison.verdict == "better"
        flights += len(runs)
    assert better / 200 >= 0.97
    assert flights / 200 <= 5.0


RUNS = [
    ([], proposed("start"), "baseline", 99.0),
    ([(1, 0.5)], proposed(error=0.3), "step", 99.0),
    ([(1, 0.5), (2, 0.4)], proposed(error=0.399), "step", 99.0),
    ([(1, 0.5), (2, 0.4), (2, 0.41)], proposed("shorter step", 0.399), "step", 99.0),
    ([(1, 0.5), (2, 0.4), (2, 0.41), (1, 0.5)], proposed(error=0.3), "step", 99.0),
    ([(1, 0.5), (2, 0.49)], proposed("manual", 0.49), "step", 99.0),
]
WITHOUT_A_STEP = [
    ([(1, 0.5), (2, 0.4)], proposed("none", 0.4), "repeat", 2.0),
    ([(1, 0.5), (2, 0.4), (2, 0.41)], proposed("none", 0.4), "baseline", 1.0),
    ([(1, 0.5), (2, 0.4), (2, 0.41), (1, 0.5)], proposed("none", 0.4), "stop", 2.0),
]


@pytest.mark.parametrize(
    ("rule", "runs", "proposal", "kind", "a"),
    [*(("paper", *run) for run in RUNS), *(("budget", *run) for run in (*RUNS, *WITHOUT_A_STEP))],
)
def test_under_the_other_rules_the_advice_is_the_strategys_step_as_long_as_there_is_one(
    rule: Literal["paper", "budget"], runs: list[tuple[float, float]], proposal: Proposal, kind: str, a: float
) -> None:
    definition = Definition(stop=StopRule(kind=rule, max_flights=12))
    flights = flown(*runs)
    verdict = evaluate_stop_rule(known(definition, flights), proposal)
    advice = advise(known(definition, flights), proposal, verdict)
    assert not verdict.stop
    assert (advice.kind, advice.gains["a"]) == (kind, a)
    assert advice.why


def test_a_step_is_advised_with_its_effect_beside_what_flights_can_tell_from_noise() -> None:
    flights = flown((1, 0.5), (2, 0.4))

    def why(error: float) -> str:
        return advised(known(PAPER, flights), proposed(error=error)).why

    assert why(0.3).startswith("The next step is predicted to reduce the error by 0.100 m, more than the 0.0082 m that")
    assert why(0.399).startswith("This step would reduce the error by 0.0010 m, less than the 0.00")
    assert why(0.41) == "This step is not predicted to reduce the error."


def test_a_campaign_reopened_after_its_rule_ended_it_is_advised_to_confirm_its_best() -> None:
    flights, proposal = flown((1, 0.5), (2, 0.4), (3, 0.41), (4, 0.42)), proposed(error=0.399)
    reopened = known(PAPER, flights, open_until_flight=6)
    verdict = evaluate_stop_rule(reopened, proposal)
    assert not verdict.stop
    advice = advise(reopened, proposal, verdict)
    assert (advice.kind, advice.gains["a"]) == ("repeat", 2.0)


def test_when_the_rule_says_stop_the_advice_is_to_stop_with_the_best() -> None:
    flights = flown((1, 0.5), (2, 0.49), (3, 0.495))
    proposal = proposed(error=0.1)
    advice = advised(known(PAPER, flights), proposal)
    assert (advice.kind, advice.gains["a"]) == ("stop", 2)
    assert "did not improve" in advice.why


def test_under_the_rule_noise_the_advice_is_the_proposal() -> None:
    flights = flown((1, 0.5), (2, 0.2))
    for kind in ("repeat", "baseline", "step"):
        advice = advised(known(NOISE, flights), proposed(kind))
        assert (advice.kind, advice.gains["a"]) == (kind, 99.0)


def test_a_campaign_reopened_after_its_decision_is_advised_to_repeat_the_best_gains() -> None:
    """Nothing else is offered, so a step must not be recommended."""
    flights = flown((1, 0.5), (2, 0.2), (2, 0.2), (1, 0.5))
    proposal = proposed("none", 0.2, a=2.0)
    reopened = known(NOISE, flights, open_until_flight=7)
    advice = advised(reopened, proposal)
    assert (advice.kind, advice.gains["a"]) == ("repeat", 2.0)
    assert "Flying the best gains again shows whether their error stays the same." in advice.why


def test_a_flight_that_is_no_step_says_why_there_is_none() -> None:
    def why(flights: list[Flight], proposal: Proposal, budget: int = 12) -> str:
        definition = replace(NOISE, stop=replace(NOISE.stop, max_flights=budget))
        return confirm(known(definition, flights), proposal).why

    once, twice = flown((1, 0.5), (2, 0.2)), flown((1, 0.5), (2, 0.2), (2, 0.2))
    decided = flown((1, 0.5), (2, 0.2), (2, 0.2), (1, 0.5))
    assert why(once, proposed("none")).endswith("No further step is flown: the strategy proposes none.")
    assert "No further step is flown: it would reduce the error by 0.0010 m, less" in why(once, proposed(error=0.199))
    assert why(once, proposed(error=0.3)).endswith("it is not predicted to reduce the error.")
    assert why(once, proposed(), 4).endswith("the last 2 flights are reserved for the best and the first gains.")
    assert why(twice, proposed()).endswith("steps end with the first repeat of the best gains.")
    assert why(decided, proposed("none")).startswith("Better with")
    assert why(decided, proposed("none")).endswith("No further step is flown: the strategy proposes none.")


def test_gains_that_look_certainly_better_are_flown_again_for_a_reason_that_is_given() -> None:
    confirmed = proposed(error=0.199)
    first = confirm(known(NOISE, flown((1, 0.5), (2, 0.2))), confirmed)
    assert first.phase == "repeat"
    assert "because no gain set has two valid flights, and the confidence assumes a prior estimate" in first.why
    then = confirm(known(NOISE, flown((1, 0.5), (2, 0.2), (2, 0.2))), confirmed)
    assert then.phase == "baseline"
    assert "they were flown once, the best gains twice" in then.why
