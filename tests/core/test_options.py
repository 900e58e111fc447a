"""Settings: what each refuses, and why."""

import pytest

from app.core.definition import Option

NUMBER = Option(name="noise", title="Noise", default=0.5, unit="rad", lower=0.0, upper=1.0)
COUNT = Option(name="seed", title="Seed", default=1, lower=0)
CHOICE = Option(name="bias", title="Bias", default="outside", choices=("outside", "inside"))


@pytest.mark.parametrize(
    ("option", "value", "reason"),
    [
        (NUMBER, 0.25, None),
        (NUMBER, 1, None),
        (NUMBER, True, "must be a number, got True"),
        (NUMBER, "much", "must be a number, got 'much'"),
        (NUMBER, float("nan"), "must be a finite number, got nan"),
        (NUMBER, 2.0, "must be between 0 and 1 rad, got 2"),
        (COUNT, 3, None),
        (COUNT, 1.5, "must be a whole number, got 1.5"),
        (COUNT, -1, "must be at least 0, got -1"),
        (CHOICE, "inside", None),
        (CHOICE, "between", "must be one of outside, inside, got 'between'"),
    ],
)
def test_a_setting_gives_the_reason_for_refusing_a_value(
    option: Option, value: float | str, reason: str | None
) -> None:
    assert option.refusal(value) == reason
