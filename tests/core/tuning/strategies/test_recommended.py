import pytest

from app.autopilots.registry import EXPERIMENTS
from app.core.tuning.strategies import recommended_strategy


@pytest.mark.parametrize(
    ("experiment", "strategy"),
    [
        ("takeoff", "calibrated"),
        ("takeoff-ardupilot", "manual"),
        ("altitude-steps-px4", "calibrated"),
        ("pitch-tracking", "gradient"),
        ("no such experiment", "calibrated"),
    ],
)
def test_an_experiment_recommends_the_first_strategy_that_works_with_it(experiment: str, strategy: str) -> None:
    assert recommended_strategy(EXPERIMENTS.get(experiment)) == strategy
