"""What a flight tells without a model: made signals, whose numbers are known."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.analysis.description import FlightSignals, describe, find_oscillation
from app.core.records.trajectory import Samples


def gusts(time_s: Samples, seed: int, *, deviation_m: float = 0.01, lasting_s: float = 0.8) -> Samples:
    """A deviation as gusts make it: red noise."""
    from scipy.signal import lfilter

    decay = np.exp(-(time_s[1] - time_s[0]) / lasting_s)
    noise = lfilter([1.0], [1.0, -decay], np.random.default_rng(seed).standard_normal(len(time_s)))
    return np.asarray(deviation_m * noise / noise.std())


def flight(*, rate_hz: float = 10.0, lasts_s: float = 60.0, seed: int = 1) -> FlightSignals:
    """10 s on the ground, a climb to 5 m in 10 s, hover with gusts, at a throttle of 0.4 ± 0.01."""
    time_s = np.arange(0.0, 20.0 + lasts_s, 1.0 / rate_hz)
    reference_m = np.clip(0.5 * (time_s - 10.0), 0.0, 5.0)
    flown = time_s > 10.0
    noise = np.random.default_rng(seed).standard_normal(len(time_s))
    return FlightSignals(
        time_s=time_s,
        altitude_m=reference_m + np.where(flown, gusts(time_s, seed), 0.0),
        climb_rate_m_s=np.gradient(reference_m, time_s),
        reference_m=reference_m,
        throttle=np.where(flown, 0.4 + 0.01 * noise + 0.1 * (time_s < 20.0), 0.0),
        flown=flown,
        held=time_s > 20.0,
        sensed_m_s2=np.zeros_like(time_s),
    )


def oscillating(signals: FlightSignals, frequency_hz: float, amplitude_m: float, since_s: float) -> FlightSignals:
    time_s = signals.time_s
    wave = np.where(time_s >= since_s, amplitude_m * np.sin(2.0 * np.pi * frequency_hz * time_s), 0.0)
    return replace(signals, altitude_m=signals.altitude_m + wave)


def test_a_hover_is_described_by_what_was_put_in() -> None:
    found = describe(flight())
    assert found is not None
    assert (found.flown_s, found.held_s) == pytest.approx((69.8, 59.8), abs=0.21)
    assert found.altitude_range_m == pytest.approx(5.0, abs=0.1)
    assert found.hover_throttle == pytest.approx(0.4, abs=0.002)
    assert found.hover_throttle_deviation == pytest.approx(0.01, rel=0.1)
    assert found.deviation_mean_m == pytest.approx(0.8 * 0.01, rel=0.15)
    assert found.deviation_largest_m is not None
    assert 0.02 < found.deviation_largest_m < 0.05
    assert (found.saturated_share, found.oscillation) == (0.0, None)


@pytest.mark.parametrize("rate_hz", [4.0, 10.0, 50.0])
@pytest.mark.parametrize(("frequency_hz", "amplitude_m", "since_s"), [(0.53, 0.2, 0.0), (1.31, 0.05, 35.0)])
def test_an_oscillation_is_found_to_a_few_percent(
    rate_hz: float, frequency_hz: float, amplitude_m: float, since_s: float
) -> None:
    found = describe(oscillating(flight(rate_hz=rate_hz), frequency_hz, amplitude_m, since_s))
    assert found is not None
    assert found.oscillation is not None
    assert found.oscillation.frequency_hz == pytest.approx(frequency_hz, rel=0.01)
    assert found.oscillation.amplitude_m == pytest.approx(amplitude_m, rel=0.05)
    assert found.oscillation.since_s == pytest.approx(max(since_s, 20.0), abs=1.5)


@pytest.mark.parametrize("seed", range(40))
def test_gusts_are_no_oscillation(seed: int) -> None:
    found = describe(flight(seed=seed))
    assert found is not None
    assert found.oscillation is None


def test_what_the_reference_commands_is_no_oscillation() -> None:
    """Steps by 2 m every 2 s, which the vehicle follows late, and a sine of the reference itself."""
    time_s = np.arange(0.0, 80.0, 0.1)
    noise = gusts(time_s, 5)
    steps_m, sine_m = 5.0 + 2.0 * np.float64(time_s % 4.0 < 2.0), 5.0 + np.sin(2.0 * np.pi * 0.4 * time_s)
    for reference_m in map(np.asarray, (steps_m, sine_m)):
        late_m = np.interp(time_s - 0.3, time_s, reference_m) - reference_m
        assert find_oscillation(time_s, late_m + noise, reference_m) is None


def test_a_few_periods_after_a_step_are_no_oscillation() -> None:
    time_s = np.arange(0.0, 60.0, 0.1)
    rings = (time_s > 20.0) * np.exp(-(time_s - 20.0) / 1.5) * np.sin(2.0 * np.pi * 0.7 * time_s)
    assert find_oscillation(time_s, 0.1 * rings + gusts(time_s, 3), np.full_like(time_s, 5.0)) is None


@pytest.mark.parametrize("frequency_hz", [0.5, 1.0])
def test_a_burst_of_three_periods_is_no_oscillation_however_strong(frequency_hz: float) -> None:
    time_s = np.arange(0.0, 12.0, 0.02)
    burst = (np.abs(time_s - 6.0) < 1.5 / frequency_hz) * np.sin(2.0 * np.pi * frequency_hz * time_s)
    deviation_m = burst + gusts(time_s, 3, deviation_m=0.002)
    assert find_oscillation(time_s, deviation_m, np.full_like(time_s, 5.0)) is None


def test_a_throttle_at_its_limits_is_counted() -> None:
    signals = flight()
    held = np.flatnonzero(signals.held)
    throttle = signals.throttle.copy()
    throttle[held[::10]] = 1.0
    found = describe(replace(signals, throttle=throttle))
    assert found is not None
    assert found.saturated_share == pytest.approx(0.1, abs=0.005)


def test_what_is_not_known_is_not_told() -> None:
    signals = flight()
    unknown = np.full_like(signals.time_s, np.nan)
    found = describe(replace(signals, climb_rate_m_s=unknown, reference_m=unknown, throttle=unknown))
    assert found is not None
    assert found.flown_s > 60.0
    assert (found.hover_throttle, found.deviation_mean_m, found.saturated_share, found.oscillation) == (None,) * 4
    assert describe(replace(signals, flown=np.zeros_like(signals.flown))) is None


def test_a_larger_transient_before_it_hides_no_oscillation() -> None:
    """As of a takeoff or of the first step, which excites the same mode."""
    time_s = np.arange(0.0, 60.0, 0.1)
    wave = np.sin(2.0 * np.pi * 1.1 * time_s)
    found = find_oscillation(time_s, (0.1 + 4.0 * np.exp(-2.0 * time_s)) * wave, np.zeros_like(time_s))
    assert found is not None
    assert (found.frequency_hz, found.amplitude_m) == pytest.approx((1.1, 0.1), rel=0.05)
