"""The gate before the reproductions' flights: which of the paper's gain sets it refuses, and for what."""

import pytest

from app.core.errors import GainsError
from app.core.policy import Gains
from app.reproductions.results import OVERRULE
from app.reproductions.tables import TABLES, judge_takeoff, overruled_for
from app.reproductions.variability import POLICIES

PUBLISHED = [
    *(
        (f"{name}, row {row}", flight.gains)
        for name, table in TABLES.items()
        for row, flight in enumerate(table.flights, start=1)
    ),
    *((policy.title, policy.gains) for policy in POLICIES),
]


def named(gains: tuple[int, int, int]) -> Gains:
    return dict(zip(("kp", "ki", "kd"), map(float, gains), strict=True))


@pytest.mark.parametrize("gains", [gains for _, gains in PUBLISHED], ids=[title for title, _ in PUBLISHED])
def test_of_the_papers_gains_those_are_refused_that_can_wrap(gains: tuple[int, int, int]) -> None:
    """ki above 1073, the largest whose product with the summed error stays below 2³¹ on every path."""
    refusals = {check.name: check for check in judge_takeoff(named(gains)).refusals}
    if gains[1] <= 1073:
        assert refusals == {}
        assert overruled_for(named(gains), "twin") == ""
    else:
        wrapping = refusals["wrapping"]
        assert (wrapping.gain, wrapping.limit) == ("ki", 2**31 - 1)
        assert wrapping.worst > wrapping.limit
        assert "stuck on the ground" in wrapping.case
        assert overruled_for(named(gains), "jsbsim") == OVERRULE


def test_seven_rows_of_the_tables_and_one_repeated_policy_are_flown_over_a_refusal() -> None:
    refused = [title for title, gains in PUBLISHED if overruled_for(named(gains), "twin")]
    assert refused == [
        *(f"table1, row {row}" for row in (6, 7, 8, 9)),
        *(f"table2, row {row}" for row in (6, 7, 8)),
        "Tuned gains 1624, 1356, 195",
    ]


def test_what_a_controller_cannot_hold_is_not_flown_for_a_reproduction_either() -> None:
    with pytest.raises(GainsError):
        overruled_for({"kp": 283.0, "ki": 13.0, "kd": float("nan")}, "twin")
