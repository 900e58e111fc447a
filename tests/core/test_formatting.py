import pytest

from app.core.formatting import (
    allowed_range,
    count,
    decimals,
    format_gains,
    gain,
    grouped,
    interval_text,
    measured,
    named_flights,
    number,
    percent,
    percent_of,
    plus_minus,
    relative_to,
    setting_text,
    short,
    short_percent,
    signed,
)


@pytest.mark.parametrize(
    ("value", "standard_error", "said"),
    [
        (0.10537, 0.01234, "0.105 ± 0.012 m"),
        (0.13189, 0.00702, "0.132 ± 0.007 m"),
        (152.3, 41.0, "152 ± 41 m"),
        (0.63, 0.00052, "0.6300 ± 0.0005 m"),
        (0.4115, 0.0, "0.411 ± 0.000 m"),
    ],
)
def test_a_difference_has_the_digits_that_its_uncertainty_supports(
    value: float, standard_error: float, said: str
) -> None:
    assert plus_minus(value, standard_error, "m") == said


def test_a_drift_has_its_sign() -> None:
    assert plus_minus(0.0312, 0.012, "m", sign="+") == "+0.031 ± 0.012 m"
    assert plus_minus(-0.0312, 0.012, "m", sign="+") == "−0.031 ± 0.012 m"


def test_a_dimensionless_quantity_has_no_unit() -> None:
    assert plus_minus(1.0049, 0.0091, "") == "1.005 ± 0.009"


def test_without_an_uncertainty_three_digits_are_enough() -> None:
    assert [short(value) for value in (0.41154, 0.0933, 3.3818, 152.3, 0.0, 2.1e-6, None)] == [
        "0.412", "0.093", "3.382", "152.300", "0.000", "0.000002", "–"]  # fmt: skip


def test_an_error_of_a_few_millimetres_has_two_significant_digits() -> None:
    assert [short(value) for value in (0.0096, 0.0094, 0.00391, 0.00041)] == ["0.010", "0.0094", "0.0039", "0.00041"]
    assert interval_text(0.00361, 0.00424) == "0.0036 … 0.0042"


def test_a_share_is_held_together_by_a_space_that_does_not_break() -> None:
    assert [percent(0.9), percent(0.9995, 1), percent(1.0)] == ["90\u00a0%", "100.0\u00a0%", "100\u00a0%"]


def test_an_error_is_told_relative_to_another() -> None:
    assert [relative_to(value, 0.5) for value in (0.139, 0.56, 2.075, 0.5001)] == [
        "72\u00a0% lower", "12\u00a0% higher", "4.2 times as high", "the same"]  # fmt: skip
    assert [relative_to(value, 0.0) for value in (0.0, 1e-300, 0.1)] == ["the same", "the same", "higher"]
    assert [percent_of(-0.1, base) for base in (0.5, 0.0, 1e-300)] == ["20\u00a0%", "", ""]


def test_a_number_that_rounds_to_zero_has_no_sign() -> None:
    assert [number(-0.0002), number(-0.012), plus_minus(-0.0002, 0.01, "m", sign="+")] == [
        "0.000", "−0.012", "+0.000 ± 0.010 m"]  # fmt: skip


def test_a_share_may_have_three_significant_digits() -> None:
    assert [short_percent(0.125), short_percent(0.9)] == ["12.5 %", "90 %"]


def test_a_range_states_only_the_limits_that_exist() -> None:
    limits = [(0.0, 409.0), (0.0, None), (None, 0.5), (None, None)]
    assert [allowed_range(*pair) for pair in limits] == ["between 0 and 409", "at least 0", "at most 0.5", "any"]


def test_amounts_have_their_nouns_and_groups_of_digits() -> None:
    assert [count(1, "flight"), count(0, "flight"), grouped(2147483647)] == ["1 flight", "0 flights", "2 147 483 647"]


def test_a_slope_has_its_sign_and_no_exponent() -> None:
    assert [signed(value) for value in (0.0123, -7.3e-06, 140.0, 0.0)] == ["+0.012", "−0.0000073", "+140", "+0.0"]


def test_flights_are_listed_in_runs_and_counted_where_there_are_many() -> None:
    assert [named_flights(numbers) for numbers in ([3], [3, 4], [1, 2, 3, 7])] == [
        "flight 3", "flights 3, 4", "flights 1–3, 7"]  # fmt: skip
    assert named_flights(range(1, 501)) == "flights 1–500"
    assert named_flights([2, 4, 6, 8, 10, 12]) == "6 flights from 2 to 12"


def test_a_table_has_true_minus_signs_and_dashes() -> None:
    assert [number(-0.1316), number(None), measured(None, 0.1, "m")] == ["−0.132", "–", "–"]
    assert [measured(-0.13189, 0.00702, "m"), measured(0.4115, None, "")] == ["−0.132 ± 0.007 m", "0.411"]
    assert decimals(float("nan")) == 3


def test_a_whole_gain_is_in_full_and_any_other_has_four_digits() -> None:
    assert [gain(12345.0), gain(-0.123456)] == ["12345", "−0.1235"]
    assert format_gains({"theta_1": -49.4692}) == "theta_1 −49.47"
    assert format_gains({"kp": -50.0, "ki": 1.5}) == "kp −50, ki 1.5"


def test_a_setting_is_printed_as_its_form_shows_it() -> None:
    settings: list[tuple[bool | float | str, str]] = [
        (True, ""),
        (False, ""),
        (10.5, "V"),
        (-2.0, "m"),
        (45.0, ""),
        ("mocap", ""),
        ("", ""),
    ]
    assert [setting_text(value, unit) for value, unit in settings] == [
        "on",
        "off",
        "10.5 V",
        "−2 m",
        "45",
        "mocap",
        "none",
    ]
