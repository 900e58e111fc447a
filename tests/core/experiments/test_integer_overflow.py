"""Products that wrap at 32 bits. The limits are figures of the vertical loop's own limiters (design: 1073 and 409)."""

import numpy as np
import pytest

from app.core.control.vertical_guidance import (
    ALT,
    ERROR_SUM_MAX,
    FB_CMD,
    INT32_MAX,
    LEVEL,
    detect_flight,
    new_state,
    step,
    wrap32,
)
from app.core.experiments import integer_overflow
from app.core.experiments.base import Check
from app.core.experiments.integer_overflow import PRODUCTS, check_wrapping
from tests.core.tuning.flying import TAKEOFF, compiled_only

TARGET = 768


def checked(kp: int, ki: int, kd: int) -> tuple[Check, ...]:
    return check_wrapping(np.array([kp, ki, kd]), TAKEOFF.nominal_model, TAKEOFF.set_points)


def test_the_largest_safe_gains_are_those_whose_product_with_the_limiter_just_fits() -> None:
    assert {product.gain: product.largest_safe_gain for product in PRODUCTS} == {"kp": 838860, "ki": 1073, "kd": 409}
    for product in PRODUCTS:
        assert wrap32(product.largest_safe_gain * product.largest_error) == (
            product.largest_safe_gain * product.largest_error
        )
        assert wrap32((product.largest_safe_gain + 1) * product.largest_error) < 0


def test_what_comes_after_the_products_cannot_wrap_whatever_they_are() -> None:
    """Three products of 32 bits, shifted by 7, 16 and 16, and a feed-forward of at most 8640."""
    assert (INT32_MAX >> 7) + 2 * (INT32_MAX >> 16) + 8640 < 2**25


@pytest.mark.parametrize("gains", [(838860, 1073, 409), (-838860, -1073, -409), (0, 0, 0)])
def test_gains_up_to_the_limits_pass_with_one_answer(gains: tuple[int, int, int]) -> None:
    (answer,) = checked(*gains)
    assert answer.passed
    assert answer.worst <= answer.limit == INT32_MAX


@compiled_only
def test_stuck_on_the_ground_names_the_instant_and_the_number_at_which_the_papers_ki_wraps() -> None:
    (refused,) = checked(1624, 1356, 195)
    assert (refused.passed, refused.gain, refused.offer) == (False, "ki", {"ki": 1073})
    assert refused.worst == 1356 * ERROR_SUM_MAX
    assert refused.case == "stuck on the ground, 5.25 s after the start: ki·(sum of errors) = 2 147 935 188"
    assert refused.case in refused.sentence


@compiled_only
def test_the_loop_itself_turns_its_thrust_over_at_the_step_that_is_named() -> None:
    """The replica in Python, held on the ground: full feedback up one step, far down the next."""
    state, thrust, feedback = new_state(0, 0), 0, []
    for _ in range(round(5.25 * 512) + 4):
        in_flight = detect_flight(state, thrust)
        thrust = step(state, ALT, TARGET, 1624, 1356, 195, 0, 0, LEVEL, in_flight)
        feedback.append(int(state[FB_CMD]))
    turned = int(np.argmin(np.diff(feedback))) + 1
    assert turned / 512 == pytest.approx(5.25, abs=0.005)
    assert feedback[turned] - feedback[turned - 1] < -60_000


@compiled_only
def test_a_gain_that_no_start_drives_to_its_limit_is_refused_all_the_same() -> None:
    (refused,) = checked(283, 13, 500)
    assert (refused.gain, refused.offer) == ("kd", {"kd": 409})
    assert refused.case == "speed error at its limiter, ±10 m/s"


@compiled_only
def test_an_estimate_that_freezes_early_in_the_climb_drives_the_sum_as_far() -> None:
    """Frozen from 0.5 … 1.5 s on, the vehicle seems to hang low for good; later it seems to have arrived."""
    (refused,) = checked(1624, 1356, 195)
    assert "It also overflows in 3 of 6 other starts" in refused.sentence


@compiled_only
def test_each_gain_that_can_wrap_is_refused_with_the_nearest_that_cannot() -> None:
    refused = checked(10**6, -1100, 410)
    assert [check.offer for check in refused] == [{"kp": 838860}, {"ki": -1073}, {"kd": 409}]


def test_uncompiled_a_short_start_finds_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """kp of 20 000 000 wraps within the first second, stuck on the ground."""
    monkeypatch.setattr(integer_overflow, "LONGEST_S", 0.6)
    (refused,) = checked(20_000_000, 0, 0)
    assert refused.case.startswith("stuck on the ground, 0.36 s")
