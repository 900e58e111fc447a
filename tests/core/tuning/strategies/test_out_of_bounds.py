"""Strategies after a best flight outside the bounds, which an operator may have overruled."""

import numpy as np
import pytest

from app.autopilots.registry import EXPERIMENTS
from app.core.definition import Definition
from app.core.tuning.strategies import STRATEGIES
from tests.core.tuning.defined import evidence, next_proposal
from tests.core.tuning.flying import TAKEOFF, compiled_only, fly
from tests.core.tuning.strategies.test_identified_model import flight
from tests.vehicles.flying import HAND

pytestmark = compiled_only

PAPERS = {"kp": 1624, "ki": 1356, "kd": 195}


@pytest.mark.parametrize("strategy", ["calibrated", "gradient", "simplex", "manual"])
@pytest.mark.parametrize("bounds", [{}, {"kp": (0.0, 600.0), "ki": (0.0, 300.0), "kd": (0.0, 150.0)}])
def test_every_proposal_lies_inside_the_bounds(strategy: str, bounds: dict[str, tuple[float, float]]) -> None:
    definition = Definition(strategy=strategy, step_fraction=0.25, bounds=bounds)
    known = evidence(definition, TAKEOFF, [fly(1, PAPERS)])
    proposal = STRATEGIES[strategy].propose(known)
    assert known.space.check(proposal.gains) == proposal.gains


def test_the_region_of_a_base_outside_lies_at_the_nearest_edge() -> None:
    low, high = TAKEOFF.space.reachable(np.array([5400.0, 13.0, -500.0]), 0.25)
    assert low.tolist() == [3000.0, 0.0, 0.0]
    assert high.tolist() == [4000.0, 281.0, 102.0]


@pytest.mark.complete
def test_the_identified_optimum_lies_inside_narrow_bounds() -> None:
    """The flown gains lie below the bounds, by more than the step limit."""
    first = flight(1, HAND)
    own = EXPERIMENTS["pitch-tracking"].space
    bounds = {gain.name: (gain.upper - 0.1 * gain.span, gain.upper) for gain in own.gains}
    definition = Definition(experiment="pitch-tracking", strategy="identified", step_fraction=0.05, bounds=bounds)
    proposal = next_proposal(definition, [first])
    assert own.narrowed(bounds).check(proposal.gains) == proposal.gains
