import pytest

from app.core.formatting import percent, plus_minus, short


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


def test_without_an_uncertainty_three_digits_are_enough() -> None:
    assert [short(value) for value in (0.41154, 0.0933, 3.3818, 152.3, 0.0, 2.1e-6, None)] == [
        "0.412", "0.0933", "3.38", "152", "0.00", "0.0000", "–"]  # fmt: skip


def test_a_share_is_held_together_by_a_space_that_does_not_break() -> None:
    assert [percent(0.9), percent(0.9995, 1), percent(1.0)] == ["90\u00a0%", "100.0\u00a0%", "100\u00a0%"]
