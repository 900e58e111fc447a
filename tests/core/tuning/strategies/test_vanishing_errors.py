"""Errors of 0, and too small to compare with, divide nothing: whatever the strategy and the stop rule."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.definition import Definition, StopRule
from app.core.tuning.proposals import advise
from app.core.tuning.stop_rules import evaluate_stop_rule
from app.core.tuning.strategies import STRATEGIES
from tests.core.tuning.defined import evidence, next_proposal
from tests.core.tuning.flying import TAKEOFF, compiled_only, fly

pytestmark = compiled_only

FLIGHTS = [
    fly(number, {"kp": kp, "ki": ki, "kd": kd})
    for number, (kp, ki, kd) in enumerate([(283, 13, 82), (283, 13, 82), (500, 50, 100)], start=1)
]
WORKING = sorted(name for name, strategy in STRATEGIES.items() if strategy.works_with(TAKEOFF))
VANISHING = st.sampled_from([0.0, 1e-300, 5e-324, 0.1])


def propose(strategy: str, rule: str, errors: list[float]) -> str:
    definition = Definition(strategy=strategy, stop=StopRule(kind=rule))  # type: ignore[arg-type]  # one of its kinds
    flights = [replace(flight, error=error) for flight, error in zip(FLIGHTS, errors, strict=False)]
    proposal, known = next_proposal(definition, flights), evidence(definition, TAKEOFF, flights)
    advise(known, proposal, evaluate_stop_rule(known, proposal))
    return proposal.explanation.summary


@pytest.mark.parametrize("error", [0.0, 1e-300])
def test_the_model_says_less_or_more_error_without_a_share(error: float) -> None:
    summary = propose("calibrated", "paper", [error])
    assert "), more error than flight 1 (kp 283, ki 13, kd 82, error 0.00" in summary


@pytest.mark.complete
@settings(max_examples=6)
@given(st.sampled_from(WORKING), st.sampled_from(["paper", "noise"]), st.lists(VANISHING, min_size=1, max_size=3))
def test_every_strategy_and_rule_bears_them(strategy: str, rule: str, errors: list[float]) -> None:
    assert propose(strategy, rule, errors)
