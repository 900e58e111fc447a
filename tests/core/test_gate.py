import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.definition import Definition, Start
from app.core.gate import Check, check_policy
from tests.core.flying import TAKEOFF, compiled_only, fly

SPACE = TAKEOFF.space
DEFAULT: dict[str, float] = {"kp": 283, "ki": 13, "kd": 82}


def check(name: str, gains: dict[str, float], definition: Definition | None = None, flown: bool = False) -> Check:
    flights = [fly(1, DEFAULT)] if flown else []
    gate = check_policy(definition or Definition(), TAKEOFF, SPACE, gains, flights)
    assert gate.passed == all(one.passed for one in gate.checks)
    return next(one for one in gate.checks if one.name == name)


@pytest.mark.parametrize(
    ("gains", "sentence", "worst"),
    [
        (DEFAULT | {"kp": -1}, "kp must lie in 0 … 4000 counts, got -1.", 1 / 4000),
        (DEFAULT | {"ki": 1356}, "ki must lie in 0 … 1073 counts, got 1356.", 283 / 1073),
        (DEFAULT | {"kd": 82.5}, "kd must be a whole number of counts, got 82.5.", 0.0),
        (DEFAULT | {"kd": math.nan}, "kd must be a finite number, got nan.", math.inf),
    ],
)
def test_gains_that_cannot_be_flown_are_refused_by_name(gains: dict[str, float], sentence: str, worst: float) -> None:
    bounds = check("bounds", gains)
    assert (bounds.passed, bounds.sentence) == (False, sentence)
    assert bounds.worst == pytest.approx(worst)


def test_before_the_first_flight_a_quarter_of_each_range_around_the_start_is_allowed() -> None:
    """kd may change by 0.25·409 = 102.25 counts."""
    assert check("step", DEFAULT | {"kd": 184}).passed
    refused = check("step", DEFAULT | {"kd": 185})
    assert not refused.passed
    assert refused.worst == pytest.approx(103 / 409)
    assert refused.limit == 0.25
    assert refused.sentence == (
        "The largest change, of kd, is 25.2% of its range; only 25% is allowed from the start "
        "gains until a flight has shown more."
    )


def test_after_a_valid_flight_the_whole_range_is_open_by_default() -> None:
    assert check("step", {"kp": 4000, "ki": 1073, "kd": 409}, flown=True).passed


def test_later_steps_are_measured_from_the_nearest_flown_gains() -> None:
    definition = Definition(step_fraction=0.1)
    flights = [fly(1, DEFAULT), fly(2, {"kp": 1600, "ki": 900, "kd": 127})]
    near = check_policy(definition, TAKEOFF, SPACE, {"kp": 2000, "ki": 1000, "kd": 100}, flights)
    far = check_policy(definition, TAKEOFF, SPACE, {"kp": 2001, "ki": 1000, "kd": 100}, flights)
    assert (near.passed, far.passed) == (True, False)


@compiled_only
def test_the_models_optimum_is_allowed_as_the_start_it_was_chosen_to_be() -> None:
    definition = Definition(start=Start(kind="simplex"))
    assert not check("step", DEFAULT, definition).passed
    assert check("step", {"kp": 1742, "ki": 881, "kd": 119}, definition).passed


@given(
    st.fixed_dictionaries({gain.name: st.integers(int(gain.lower), int(gain.upper)) for gain in SPACE.gains}),
    st.floats(0.01, 1.0),
)
def test_what_is_reachable_passes_and_what_passes_is_reachable(gains: dict[str, float], fraction: float) -> None:
    definition = Definition(first_step_fraction=fraction)
    low, high = SPACE.reachable(SPACE.default, fraction)
    reachable = bool(((low <= SPACE.vector(gains)) & (SPACE.vector(gains) <= high)).all())
    assert check_policy(definition, TAKEOFF, SPACE, gains, []).passed == reachable


def test_a_pinned_gain_is_refused_at_any_other_value_and_flown_at_its_own() -> None:
    space = TAKEOFF.space.narrowed({"ki": (13, 13)})
    definition = Definition(bounds={"ki": (13, 13)})
    own, other = (check_policy(definition, TAKEOFF, space, DEFAULT | {"ki": ki}, []) for ki in (13, 14))
    assert (own.passed, other.passed) == (True, False)
    refused = other.checks[0]
    assert (refused.name, refused.gain, refused.worst) == ("bounds", "ki", math.inf)


def test_a_refused_step_names_its_gain() -> None:
    gate = check_policy(Definition(), TAKEOFF, TAKEOFF.space, DEFAULT | {"kd": 400}, [])
    assert [(check.name, check.gain) for check in gate.checks if not check.passed] == [("step", "kd")]
