"""Shapes of failure in made signals, whose numbers are known."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.core.analysis.description import FlightSignals, describe
from app.core.analysis.shapes import FailureShape, FoundShape, find_shapes
from app.core.models.copter import GRAVITY_M_S2
from app.core.records.trajectory import Samples

HOVER = 0.4
TIME_S = np.arange(0.0, 60.0, 0.1)
FLOWN = TIME_S >= 5.0


def flight(accelerations_m_s2: Samples | None = None, **changes: Any) -> FlightSignals:
    """5 s on the ground, a climb of 5 m in 5 s, and a hover; with the accelerations, the throttle and the noise of a
    sound copter."""
    noise = np.random.default_rng(1).standard_normal((2, len(TIME_S)))
    reference_m = np.clip(TIME_S - 5.0, 0.0, 5.0)
    rates = np.gradient(reference_m, TIME_S)
    moved = np.zeros_like(TIME_S) if accelerations_m_s2 is None else accelerations_m_s2
    signals = FlightSignals(
        time_s=TIME_S,
        altitude_m=reference_m + 0.005 * noise[0],
        climb_rate_m_s=rates,
        reference_m=reference_m,
        throttle=np.where(FLOWN, HOVER * (1.0 + moved / GRAVITY_M_S2) + 0.005 * noise[1], 0.0),
        flown=FLOWN,
        held=FLOWN,
        sensed_m_s2=0.2 * noise[0],
        assumed_hover=HOVER,
    )
    return replace(signals, **changes)


def found_in(signals: FlightSignals) -> Sequence[FoundShape]:
    return find_shapes(signals, describe(signals))


def only(signals: FlightSignals, shape: FailureShape) -> FoundShape:
    (found,) = found_in(signals)
    assert found.shape is shape
    return found


def test_a_sound_flight_has_no_shape() -> None:
    assert list(found_in(flight())) == []


def test_nothing_is_found_of_what_never_flew() -> None:
    assert list(found_in(flight(flown=np.zeros_like(FLOWN)))) == []


def test_an_altitude_that_rings_has_the_frequency_and_amplitude_put_in() -> None:
    sound = flight()
    wave = np.where(TIME_S > 20.0, 0.2 * np.sin(2.0 * np.pi * 0.7 * TIME_S), 0.0)
    found = only(replace(sound, altitude_m=sound.altitude_m + wave), FailureShape.RINGING)
    assert found.numbers == pytest.approx({"frequency_hz": 0.7, "amplitude_m": 0.2}, rel=0.05)
    assert found.since_s == pytest.approx(20.0, abs=2.5)


def test_a_line_below_what_an_estimate_wanders_is_no_ringing() -> None:
    sound = flight()
    wave = 0.03 * np.sin(2.0 * np.pi * 0.7 * TIME_S)
    small = replace(sound, altitude_m=sound.reference_m + wave)
    described = describe(small)
    assert described is not None
    assert described.oscillation is not None
    assert list(find_shapes(small, described)) == []


def test_of_a_flight_that_rings_nothing_is_told_that_needs_rest() -> None:
    """Neither the hover throttle, which is not seen, nor noise and wind, which ringing looks like."""
    sound = flight()
    wave = 0.2 * np.sin(2.0 * np.pi * 0.7 * TIME_S)
    found = only(
        replace(
            sound,
            altitude_m=sound.altitude_m + wave,
            assumed_hover=0.2,
            sensed_m_s2=3.0 * np.random.default_rng(2).standard_normal(len(TIME_S)),
        ),
        FailureShape.RINGING,
    )
    assert found.shape is FailureShape.RINGING


def overshooting(overshoot_m: float, decays_s: float, *, again_m: float = 0.0) -> FlightSignals:
    """An overshoot 1 s after lift-off that decays exponentially, and another 20 s later."""
    since_s = TIME_S - 6.0
    above_m = np.where(since_s >= 0.0, overshoot_m * np.exp(-np.maximum(since_s, 0.0) / decays_s), 0.0)
    above_m += np.where(since_s >= 20.0, again_m * np.exp(-np.maximum(since_s - 20.0, 0.0) / decays_s), 0.0)
    sound = flight()
    return replace(sound, altitude_m=sound.altitude_m + above_m)


def shapes_in(signals: FlightSignals) -> set[FailureShape]:
    return {each.shape for each in found_in(signals)}


def test_an_overshoot_after_lift_off_that_decays_slowly_is_a_wound_integral() -> None:
    found = {each.shape: each for each in found_in(overshooting(0.6, 2.0))}[FailureShape.WINDUP]
    assert found.numbers["overshoot_m"] == pytest.approx(0.6, abs=0.02)
    assert found.numbers["lasts_s"] == pytest.approx(2.0 * np.log(2.0), abs=0.15)
    assert found.since_s == pytest.approx(5.0)


@pytest.mark.parametrize(
    "signals",
    [
        pytest.param(overshooting(0.6, 0.5), id="soon over"),
        pytest.param(overshooting(0.15, 2.0), id="small"),
        pytest.param(overshooting(0.6, 2.0, again_m=0.6), id="repeated"),
        pytest.param(replace(overshooting(0.6, 2.0), flown=np.ones_like(FLOWN)), id="begins in the air"),
        pytest.param(replace(overshooting(0.6, 2.0), reference_m=np.full(len(TIME_S), np.nan)), id="no reference"),
    ],
)
def test_other_overshoots_are_no_wound_integral(signals: FlightSignals) -> None:
    assert FailureShape.WINDUP not in shapes_in(signals)


def test_an_altitude_above_a_reference_that_comes_down_is_no_wound_integral() -> None:
    late_m = np.clip(TIME_S - 5.0, 0.0, 5.0) - np.clip(TIME_S - 11.0, 0.0, 4.0)
    signals = flight(reference_m=late_m, altitude_m=np.interp(TIME_S - 0.6, TIME_S, late_m))
    assert np.max(signals.altitude_m - late_m) > 0.5
    assert FailureShape.WINDUP not in shapes_in(signals)


@pytest.mark.parametrize("assumed", [0.35, 0.46])
def test_a_hover_throttle_beside_its_parameter_is_told_with_both(assumed: float) -> None:
    found = only(flight(assumed_hover=assumed), FailureShape.HOVER_THROTTLE)
    assert found.numbers == pytest.approx({"hover_throttle_1": HOVER, "assumed_1": assumed}, rel=0.01)


@pytest.mark.parametrize("assumed", [0.37, 0.43, None])
def test_a_parameter_near_the_hover_throttle_is_right(assumed: float | None) -> None:
    assert list(found_in(flight(assumed_hover=assumed))) == []


def test_a_throttle_that_scatters_tells_nothing_of_its_parameter() -> None:
    scattered = HOVER + 0.1 * np.random.default_rng(3).standard_normal(len(TIME_S))
    assert FailureShape.HOVER_THROTTLE not in shapes_in(flight(assumed_hover=0.5, throttle=scattered))


def climbing(at_limit_s: Sequence[tuple[float, float]], rate_m_s: float = 1.0) -> FlightSignals:
    """A climb from 20 s on with the throttle at its limit in between, half a metre behind."""
    sound = flight()
    reference_m = 5.0 + rate_m_s * np.clip(TIME_S - 20.0, 0.0, 10.0)
    limited = np.any([(begin <= TIME_S) & (end >= TIME_S) for begin, end in at_limit_s], axis=0)
    return replace(
        sound,
        reference_m=reference_m,
        altitude_m=reference_m - 0.5 * limited * np.sin(0.1 * TIME_S) ** 2,
        throttle=np.where(limited, 1.0, sound.throttle),
        flown=np.ones_like(FLOWN),
        held=np.ones_like(FLOWN),
    )


def test_a_climb_at_the_throttles_limit_is_told_by_its_longest_time() -> None:
    signals = climbing([(20.45, 21.55), (23.0, 26.0)])
    found = {each.shape: each for each in found_in(signals)}[FailureShape.SATURATED_CLIMB]
    assert found.numbers["at_limit_s"] == pytest.approx(3.0)
    assert found.numbers["behind_m"] == pytest.approx(0.5 * np.sin(2.3) ** 2, abs=0.02)
    assert found.since_s == pytest.approx(23.0)


def test_a_short_limit_and_one_without_a_climb_are_none() -> None:
    assert FailureShape.SATURATED_CLIMB not in shapes_in(climbing([(23.0, 23.5)]))
    assert FailureShape.SATURATED_CLIMB not in shapes_in(climbing([(23.0, 26.0)], rate_m_s=0.0))


def test_a_jump_of_the_estimate_is_told_with_its_size_and_time() -> None:
    sound = flight()
    jumped = replace(
        sound,
        altitude_m=sound.altitude_m + 1.5 * (TIME_S > 30.05),
        reference_m=sound.reference_m + 1.5 * (TIME_S > 30.05),
        climb_rate_m_s=sound.climb_rate_m_s + 3.0 * (np.abs(TIME_S - 40.1) < 0.01),
    )
    found = {each.shape: each for each in found_in(jumped)}[FailureShape.ESTIMATOR_JUMP]
    assert found.numbers == pytest.approx({"altitude_m": 1.5, "climb_rate_m_s": 0.0, "jumps_1": 3.0}, abs=0.03)
    assert found.since_s == pytest.approx(30.1)


def test_rows_far_apart_and_a_fall_are_no_jump() -> None:
    kept = (TIME_S < 30.0) | (TIME_S > 30.6)
    sound = flight()
    apart = {name: getattr(sound, name)[kept] for name in ("time_s", "climb_rate_m_s", "throttle", "flown", "held")}
    high_m = (sound.altitude_m + 3.0 * (TIME_S > 30.0))[kept]
    sparse = replace(sound, **apart, altitude_m=high_m, reference_m=high_m, sensed_m_s2=np.zeros(int(kept.sum())))
    assert FailureShape.ESTIMATOR_JUMP not in shapes_in(sparse)
    falls_s = np.clip(TIME_S - 50.0, 0.0, 1.0)
    falling = replace(
        sound,
        altitude_m=sound.altitude_m - 0.5 * GRAVITY_M_S2 * falls_s**2,
        climb_rate_m_s=sound.climb_rate_m_s - GRAVITY_M_S2 * falls_s * (TIME_S < 51.0),
        flown=FLOWN & (TIME_S < 51.0),
    )
    assert FailureShape.ESTIMATOR_JUMP not in shapes_in(falling)


def test_noise_of_the_sensed_acceleration_is_told_with_its_deviation() -> None:
    sensed = 2.0 * np.random.default_rng(4).standard_normal(len(TIME_S))
    found = only(flight(sensed_m_s2=sensed), FailureShape.VIBRATION)
    assert found.numbers["noise_m_s2"] == pytest.approx(2.0, rel=0.1)
    assert found.since_s == pytest.approx(5.0)


def test_accelerations_that_the_climb_rate_or_the_next_row_has_too_are_no_vibration() -> None:
    """Jolts that move the vehicle, and a slow one that the estimate does not follow."""
    jolts = 2.0 * np.random.default_rng(4).standard_normal(len(TIME_S))
    rates = np.append(0.0, np.cumsum(0.5 * (jolts[1:] + jolts[:-1]) * np.diff(TIME_S)))
    assert FailureShape.VIBRATION not in shapes_in(flight(sensed_m_s2=jolts, climb_rate_m_s=rates))
    assert FailureShape.VIBRATION not in shapes_in(flight(sensed_m_s2=3.0 * np.sin(TIME_S)))


def test_without_a_sensed_acceleration_no_vibration_is_told() -> None:
    assert list(found_in(flight(sensed_m_s2=np.full(len(TIME_S), np.nan)))) == []


PUSHED = np.sqrt(2.0) * np.sin(2.0 * np.pi * TIME_S / 8.0)


def test_a_throttle_that_works_against_something_tells_of_wind() -> None:
    """A slow sine of 1 m/s² rms that the throttle cancels; a second's mean of it is 2.5 % less."""
    found = only(flight(PUSHED), FailureShape.WIND)
    assert found.numbers["disturbance_m_s2"] == pytest.approx(1.0, rel=0.06)
    assert found.since_s == pytest.approx(11.0, abs=0.6)


def test_a_throttle_that_accelerates_the_vehicle_tells_of_none() -> None:
    rates = np.append(0.0, np.cumsum(PUSHED[1:] * np.diff(TIME_S)))
    assert FailureShape.WIND not in shapes_in(flight(PUSHED, climb_rate_m_s=rates))


@pytest.mark.parametrize(
    "changes",
    [
        {"throttle": np.full(len(TIME_S), np.nan)},
        {"reference_m": 5.0 + np.sin(TIME_S), "altitude_m": 5.0 + np.sin(TIME_S)},
        {"climb_rate_m_s": np.full(len(TIME_S), 2.0)},
    ],
    ids=["no throttle", "never rests", "no hover"],
)
def test_without_a_hover_no_wind_is_told(changes: dict[str, Samples]) -> None:
    assert FailureShape.WIND not in shapes_in(flight(PUSHED, **changes))


def test_an_estimate_that_vibration_drives_tells_of_no_wind() -> None:
    sensed = 2.0 * np.random.default_rng(4).standard_normal(len(TIME_S))
    assert shapes_in(flight(PUSHED, sensed_m_s2=sensed)) == {FailureShape.VIBRATION}
