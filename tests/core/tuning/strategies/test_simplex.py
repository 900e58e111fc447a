import numpy as np
import pytest

from app.core.definition import Definition
from app.core.experiments.takeoff import Takeoff
from app.core.tuning.corrected_model import model_optimum
from app.core.tuning.strategies.simplex import nominal_model, propose
from tests.core.tuning.bowl import QuadraticExperiment, fly
from tests.core.tuning.defined import evidence
from tests.core.tuning.flying import compiled_only

BOWL = QuadraticExperiment()


@compiled_only
def test_the_search_on_the_nominal_takeoff_finds_the_papers_near_optimum_inside_the_bounds() -> None:
    """The reference alone scores 0.0913 m: nothing that follows it can do better."""
    takeoff = Takeoff()
    optimum = model_optimum(takeoff, takeoff.space, takeoff.space.default)
    assert optimum.evaluations <= 300
    assert 0.0905 < optimum.error < 0.0925
    assert (optimum.gains == takeoff.space.nearest(optimum.gains)).all()


@pytest.mark.parametrize("start", [(90.0, 90.0), (100.0, 100.0), (0.0, 0.0)])
def test_the_search_reaches_a_known_optimum_from_any_corner(start: tuple[float, float]) -> None:
    optimum = model_optimum(BOWL, QuadraticExperiment.space, np.array(start))
    assert optimum.gains == pytest.approx([30.0, 40.0], abs=1e-3)
    assert optimum.error == pytest.approx(1.0, abs=1e-6)
    assert optimum.evaluations <= 300


def test_as_a_strategy_it_flies_the_models_optimum_once() -> None:
    first = propose(evidence(Definition(), BOWL, [fly(1, 90.0, 90)]))
    assert first.kind == "step"
    assert first.gains == pytest.approx({"a": 30.0, "b": 40}, abs=1e-3)
    assert first.predicted_error == pytest.approx(1.0, abs=1e-6)
    flown = [fly(1, 90.0, 90), fly(2, first.gains["a"], first.gains["b"])]
    second = propose(evidence(Definition(), BOWL, flown))
    assert second.kind == "none"
    assert second.gains == flown[1].gains
    assert "proposes nothing else" in second.explanation.summary


def test_a_step_limit_lets_it_approach_the_optimum_flight_by_flight() -> None:
    proposal = propose(evidence(Definition(step_fraction=0.2), BOWL, [fly(1, 90.0, 90)]))
    assert proposal.gains == pytest.approx({"a": 70.0, "b": 70})
    assert proposal.explanation.clipped == ("a", "b")


def test_the_search_leaves_a_pinned_gain_where_it_is() -> None:
    pinned = QuadraticExperiment.space.narrowed({"b": (70, 70)})
    optimum = model_optimum(BOWL, pinned, np.array([90.0, 70.0]))
    assert optimum.gains == pytest.approx([30.0, 70.0], abs=1e-3)


def test_its_landscape_is_the_nominal_models_whatever_flew() -> None:
    errors = nominal_model(evidence(Definition(), BOWL, [fly(1, 90.0, 90)])).errors(
        np.array([[30.0, 40.0], [90.0, 90.0]])
    )
    assert errors[0] == pytest.approx(1.0, abs=1e-6)
    assert errors[1] > errors[0]
