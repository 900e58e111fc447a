import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.errors import GainsError
from app.core.experiments.takeoff import Takeoff
from tests.core.tuning.bowl import QuadraticExperiment

SPACE = Takeoff().space
GOOD = {"kp": 283, "ki": 13, "kd": 82}


@pytest.mark.parametrize(
    ("gains", "problems"),
    [
        ({"kp": -1, "ki": 13, "kd": 82}, {"gains.kp": "must be between 0 and 4000 counts, got -1"}),
        ({"kp": 1, "ki": 13.5, "kd": 82}, {"gains.ki": "must be a whole number of counts, got 13.5"}),
        (
            {"kp": math.nan, "ki": math.inf, "kd": 82},
            {"gains.kp": "must be a finite number, got nan", "gains.ki": "must be a finite number, got inf"},
        ),
        (
            {"kp": 10**400, "ki": 13, "kd": 82},
            {"gains.kp": f"must be a finite number, got 1{'0' * 36}…"},
        ),
        (
            {"kp": "283", "ki": True, "kd": None},
            {"gains.kp": "must be a number", "gains.ki": "must be a number", "gains.kd": "must be a number"},
        ),
        (
            {"kp": 283, "kx": 1},
            {
                "gains.kx": "is not a gain of this experiment (kp, ki, kd)",
                "gains.ki": "is missing",
                "gains.kd": "is missing",
            },
        ),
    ],
)
def test_unusable_gains_are_refused_naming_each(gains: dict[str, object], problems: dict[str, str]) -> None:
    with pytest.raises(GainsError) as refusal:
        SPACE.check(gains)
    assert {problem.field: problem.reason for problem in refusal.value.problems} == problems


def test_good_gains_come_back_whole_and_in_order() -> None:
    checked = SPACE.check({"kd": 82.0, "kp": 283, "ki": 13})
    assert list(checked.items()) == [("kp", 283), ("ki", 13), ("kd", 82)]
    assert all(type(value) is int for value in checked.values())


@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3))
def test_the_nearest_flyable_vector_is_flyable(values: list[float]) -> None:
    nearest = SPACE.nearest(np.array(values))
    assert SPACE.check(SPACE.mapping(nearest)) == SPACE.mapping(nearest)


@given(st.integers(0, 4000), st.integers(0, 1073), st.integers(0, 409), st.floats(0.001, 1.0))
def test_what_is_reachable_lies_within_the_fraction_and_holds_the_base(kp: int, ki: int, kd: int, share: float) -> None:
    base = np.array([kp, ki, kd], dtype=np.float64)
    for end in SPACE.reachable(base, share):
        assert (SPACE.nearest(end) == end).all()
        assert max(SPACE.change(SPACE.mapping(end), SPACE.mapping(base)).values()) <= share + 1e-9
    low, high = SPACE.reachable(base, share)
    assert ((low <= base) & (base <= high)).all()


def test_real_valued_gains_are_neither_rounded_nor_made_whole() -> None:
    space = QuadraticExperiment.space
    assert space.mapping(space.nearest(np.array([2.25, 39.6]))) == {"a": 2.25, "b": 40}
    low, high = space.reachable(np.array([50.0, 50.0]), 0.125)
    assert low == pytest.approx([37.5, 38.0])
    assert high == pytest.approx([62.5, 62.0])


def test_tighter_bounds_narrow_the_space_and_leave_the_rest() -> None:
    narrow = SPACE.narrowed({"kp": (100, 200)})
    assert narrow.lower.tolist() == [100, 0, 0]
    assert narrow.upper.tolist() == [200, 1073, 409]
    assert narrow.scale.tolist() == SPACE.scale.tolist()
