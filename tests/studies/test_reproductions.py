import pytest

from app.core.errors import InputError
from app.studies.reproductions import TABLES, Reproduced, reproduce


@pytest.fixture(scope="module")
def table1() -> list[Reproduced]:
    return reproduce("table1")


@pytest.fixture(scope="module")
def table2() -> list[Reproduced]:
    return reproduce("table2")


def on(rows: list[Reproduced], vehicle: str) -> list[Reproduced]:
    return [row for row in rows if row.vehicle == vehicle]


def test_table_1_on_jsbsim_is_within_1_5_percent_of_the_reference(table1: list[Reproduced]) -> None:
    for row in on(table1, "jsbsim"):
        assert row.measured == pytest.approx(row.reference, rel=0.015), row.gains


def test_the_rows_of_table_1_above_0_1_m_keep_their_order_and_1649_1365_175_is_best(table1: list[Reproduced]) -> None:
    rows = on(table1, "jsbsim")
    high = [row for row in rows if row.reference is not None and row.reference > 0.1]
    assert len(high) == 5
    assert sorted(high, key=lambda row: row.measured) == sorted(high, key=lambda row: row.reference or 0.0)
    assert min(rows, key=lambda row: row.measured).gains == {"kp": 1649, "ki": 1365, "kd": 175}


@pytest.mark.parametrize(
    ("row", "overshoot_m"),
    list(enumerate([0.497, 0.478, 0.461, 0.465, 0.453, 0.038, 0.024, 0.030, 0.036])),
)
def test_table_1_overshoots_as_the_reference(table1: list[Reproduced], row: int, overshoot_m: float) -> None:
    """The third column of the reference measurement."""
    assert on(table1, "jsbsim")[row].overshoot_m == pytest.approx(overshoot_m, abs=0.008)


def test_table_2_on_the_twin_without_noise_is_within_1_percent_of_the_reference(table2: list[Reproduced]) -> None:
    for row in on(table2, "twin"):
        assert row.measured == pytest.approx(row.reference, rel=0.01), row.gains


def test_every_gain_set_is_flown_on_both_vehicles_the_tables_own_first(
    table1: list[Reproduced], table2: list[Reproduced]
) -> None:
    assert [row.vehicle for row in table1] == ["jsbsim"] * 9 + ["twin"] * 9
    assert [row.vehicle for row in table2] == ["twin"] * 8 + ["jsbsim"] * 8
    assert {row.table for row in table1} == {1}
    assert {row.table for row in table2} == {2}


def test_ratios_are_measured_over_published(table1: list[Reproduced]) -> None:
    for row, published in zip(on(table1, "jsbsim"), TABLES["table1"].flights, strict=True):
        assert row.paper == published.paper
        assert row.ratio == pytest.approx(row.measured / published.paper)
        assert tuple(row.gains.values()) == published.gains


def test_progress_is_told_row_by_row(table2: list[Reproduced]) -> None:
    told: list[Reproduced] = []
    rows = reproduce("table2", vehicles=["twin"], on_row=told.append)
    assert told == rows == on(table2, "twin")


def test_an_unknown_table_or_vehicle_is_refused_by_name() -> None:
    with pytest.raises(InputError) as refusal:
        reproduce("table3")
    assert refusal.value.problems[0].field == "table"
    with pytest.raises(InputError) as refusal:
        reproduce("table1", vehicles=["import"])
    assert refusal.value.problems[0].field == "vehicle"
