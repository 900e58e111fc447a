"""Step responses against those of systems whose answer is known in closed form."""

from math import exp, log, pi, sqrt

import numpy as np
import pytest

from app.core.records.metrics import StepResponse, step_response
from app.core.records.trajectory import Samples

STEP_S = 1e-3
WINDOW_S = 20.0
TIME_S = np.arange(-0.5, WINDOW_S + STEP_S / 2, STEP_S)


def three(time_s: Samples) -> Samples:
    return np.where(time_s >= 0.0, 3.0, 0.0)


def respond(values: Samples, time_s: Samples = TIME_S) -> StepResponse:
    found = step_response(time_s, values, three, WINDOW_S)
    assert found is not None
    return found


def test_several_steps_have_no_single_response() -> None:
    assert step_response(TIME_S, three(TIME_S), lambda at: np.where(at < 10.0, three(at), 2.0), WINDOW_S) is None


def test_a_first_order_lag_rises_in_ln_9_and_settles_in_ln_20_time_constants() -> None:
    lag_s = 0.8
    found = respond(np.where(TIME_S > 0.0, 3.0 * (1.0 - np.exp(-TIME_S / lag_s)), 0.0))
    assert found.rise_time_s == pytest.approx(lag_s * log(9.0), abs=STEP_S)
    assert found.settling_time_s == pytest.approx(lag_s * log(20.0), abs=STEP_S)
    assert found.overshoot == 0.0
    assert found.steady_state_error == pytest.approx(0.0, abs=1e-6)


def test_a_second_order_system_is_measured_as_the_textbook_computes_it() -> None:
    """Damping 0.5: an overshoot of 16.3 %; its rise and settling as scipy integrates the same system."""
    signal = pytest.importorskip("scipy.signal")
    damping, natural = 0.5, 2.0
    after = TIME_S[TIME_S >= 0.0]
    _, unit = signal.step(([natural**2], [1.0, 2.0 * damping * natural, natural**2]), T=after)
    found = respond(np.concatenate([np.zeros(len(TIME_S) - len(after)), 3.0 * unit]))
    assert found.overshoot == pytest.approx(3.0 * exp(-pi * damping / sqrt(1.0 - damping**2)), abs=1e-4)
    ten, ninety = (next(t for t, y in zip(after, unit, strict=True) if y >= share) for share in (0.1, 0.9))
    assert found.rise_time_s == pytest.approx(ninety - ten, abs=2 * STEP_S)
    last = max(t for t, y in zip(after, unit, strict=True) if abs(y - 1.0) > 0.05)
    assert found.settling_time_s == pytest.approx(last, abs=2 * STEP_S)


def test_a_flight_that_hovers_too_high_has_a_positive_steady_state_error_and_does_not_settle() -> None:
    found = respond(np.where(TIME_S >= 1.0, 3.2, 0.0))
    assert found.steady_state_error == pytest.approx(0.2)
    assert found.settling_time_s is None
    assert found.overshoot == pytest.approx(0.2)


def test_the_last_departure_from_the_band_counts_not_the_first_arrival() -> None:
    gust = np.where((TIME_S > 11.0) & (TIME_S < 12.0), 0.4, 0.0)
    assert respond(np.where(TIME_S > 1.0, 3.0, 0.0) + gust).settling_time_s == pytest.approx(12.0, abs=2 * STEP_S)


def test_times_between_coarse_samples_are_interpolated() -> None:
    """A ramp to 3 m in 3 s, sampled every 1.5 s: 10 % at 0.3 s, 90 % at 2.7 s, within 5 % from 2.85 s on."""
    time_s = np.arange(0.0, WINDOW_S + 0.1, 1.5)
    found = respond(np.minimum(time_s, 3.0), np.append(time_s[:-1], WINDOW_S))
    assert found.rise_time_s == pytest.approx(2.4)
    assert found.settling_time_s == pytest.approx(2.85)


def test_a_record_that_starts_inside_the_band_was_settled_from_the_start() -> None:
    found = respond(np.full_like(TIME_S, 3.0))
    assert found.rise_time_s == 0.0
    assert found.settling_time_s == pytest.approx(0.0, abs=STEP_S)


def test_a_flight_broken_off_has_no_steady_state() -> None:
    short = TIME_S[TIME_S < 6.0]
    found = respond(np.minimum(np.maximum(short, 0.0), 3.0), short)
    assert found.rise_time_s == pytest.approx(2.4, abs=2 * STEP_S)
    assert (found.settling_time_s, found.steady_state_error) == (None, None)
    assert found.overshoot == 0.0


def test_a_flight_broken_off_below_the_set_point_has_no_overshoot() -> None:
    short = TIME_S[TIME_S < 6.0]
    assert respond(np.full_like(short, 2.0), short).overshoot is None
    assert respond(np.full_like(TIME_S, 2.0)).overshoot == 0.0


def test_a_flight_that_never_reached_90_percent_has_no_rise_time() -> None:
    assert respond(np.full_like(TIME_S, 2.0)).rise_time_s is None


def test_what_comes_after_the_window_does_not_matter() -> None:
    time_s = np.arange(0.0, 2.0 * WINDOW_S, 0.01)
    landed = np.where(time_s <= WINDOW_S, 3.0, 0.0)
    assert respond(landed, time_s).steady_state_error == pytest.approx(0.0)


def test_a_window_with_a_single_sample_at_its_end_has_that_steady_state() -> None:
    found = respond(np.array([0.0, 1.0, 3.1]), np.array([0.0, 1.0, WINDOW_S - 0.1]))
    assert found.steady_state_error == pytest.approx(0.1)


def test_without_a_step_there_is_no_response() -> None:
    assert step_response(TIME_S, np.ones_like(TIME_S), np.zeros_like, WINDOW_S) is None
    assert step_response(np.array([-1.0, 0.5]), np.ones(2), three, WINDOW_S) is None
