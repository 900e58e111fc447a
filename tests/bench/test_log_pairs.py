"""What the bench of pairs of logs counts as told; what it counts is measured by the bench itself."""

import pytest

from bench.log_pairs import Judged, judge
from tests.core.tuning.flying import compiled_only


def judged(truth: float, told: str) -> Judged:
    return Judged(
        autopilot="PX4",
        change="all gains",
        other_weather=False,
        truth=truth,
        told=told,
        estimate=truth,
        measured=told,
        is_contradicted=False,
        took_s=0.1,
    )


@pytest.mark.parametrize(
    ("truth", "told", "expected"),
    [
        (-3.0, "better", (True, False, True)),
        (3.0, "worse", (True, False, True)),
        (3.0, "better", (False, True, False)),
        (3.0, "unresolved", (False, False, False)),
        (3.0, "no model", (False, False, False)),
        (0.9, "unresolved", (True, False, True)),
        (0.9, "worse", (False, True, False)),
        (1.5, "worse", (True, False, False)),
        (2.0, "worse", (True, False, True)),
        (1.5, "unresolved", (True, False, True)),
        (2.0, "unresolved", (True, False, False)),
        (1.5, "better", (False, True, False)),
    ],
)
def test_a_difference_is_told_where_two_flights_can_tell_it(
    truth: float, told: str, expected: tuple[bool, bool, bool]
) -> None:
    found = judged(truth, told)
    assert (found.is_told, found.is_wrong, found.is_told_strictly) == expected


@compiled_only
@pytest.mark.complete
@pytest.mark.parametrize("number", [0, 3, 8])
def test_a_pair_is_told(number: int) -> None:
    assert judge(number, seed=1).is_told
