"""When a re-tune is due: numbers worked out by hand."""

from app.core.experiments.base import Fitted
from app.core.statistics.drift import drift


def hover(value: float, standard_error: float) -> dict[str, Fitted]:
    return {
        "hover_throttle": Fitted(
            name="hover_throttle", title="Hover throttle", unit="of full", value=value, standard_error=standard_error
        )
    }


def lag(value: float, standard_error: float) -> dict[str, Fitted]:
    return {
        "motor_lag_s": Fitted(
            name="motor_lag_s", title="Motor lag", unit="s", value=value, standard_error=standard_error
        )
    }


def test_a_change_within_the_interval_is_no_drift() -> None:
    # 1.960 · √(0.003² + 0.004²) = 0.0098
    assert not drift(hover(0.6, 0.003), hover(0.6097, 0.004)).due


def test_a_change_beyond_the_interval_makes_a_re_tune_due_and_is_reported() -> None:
    found = drift(hover(0.6, 0.003), hover(0.6099, 0.004))
    assert (found.due, found.drifted) == (True, ("hover_throttle",))
    assert found.sentence == (
        "The vehicle has changed significantly since it was last tuned: hover throttle from 0.6000 ± 0.0030 to "
        "0.6099 ± 0.0040 of full. Find the cause (propellers, weight), then tune it again."
    )


def test_of_two_parameters_each_is_allowed_more() -> None:
    # z = Φ⁻¹(1 − 0.0125) = 2.2414, so that 2.2414 · 0.005 = 0.01121 is allowed
    before, steady = hover(0.6, 0.003) | lag(0.05, 0.01), lag(0.05, 0.01)
    assert not drift(before, hover(0.6112, 0.004) | steady).due
    assert drift(before, hover(0.6113, 0.004) | steady).drifted == ("hover_throttle",)


def test_parameters_that_only_one_fit_has_are_not_compared() -> None:
    found = drift(hover(0.6, 0.001), lag(0.2, 0.001))
    assert not found.due
    assert "no parameter in common" in found.sentence


def test_what_is_known_exactly_is_told_without_an_uncertainty() -> None:
    found = drift(hover(0.6, 0.0), hover(0.61, 0.0))
    assert found.due
    assert "hover throttle from 0.6 to 0.61 of full" in found.sentence
