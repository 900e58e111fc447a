"""The clock by which everything waits."""

import time

import pytest

from app.core.clock import REAL_TIME, ScaledClock
from app.core.errors import InputError


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_clock_that_would_stand_or_go_back_is_refused(speed: float) -> None:
    with pytest.raises(InputError) as refusal:
        ScaledClock(speed)
    assert refusal.value.problems[0].field == "clock_speed"


def test_what_is_waited_for_has_passed_and_takes_its_share_of_the_wall() -> None:
    clock = ScaledClock(1000.0)
    begun_s = clock.now_s()
    clock.wait_s(2.0)
    clock.wait_s(-1.0)
    assert clock.now_s() - begun_s >= 2.0
    assert clock.wall_s(2.0) == pytest.approx(0.002)


def test_real_time_is_this_computers() -> None:
    before_s = time.monotonic()
    assert before_s <= REAL_TIME.now_s() <= time.monotonic()
