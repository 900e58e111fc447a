"""Records from elsewhere: which show no flight of their experiment, and which show one in another unit or datum."""

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from app.autopilots.registry import EXPERIMENTS, get_experiment
from app.core.records.plausibility import ExpectedFlight, Implausible, Reading, find_implausible, find_readings, read_as
from app.core.records.trajectory import Samples, Trajectory
from app.logs.takeoff_csv import read_takeoff_csv

TAKEOFFS: Final = Path(__file__).parents[2] / "data" / "takeoffs"
TIME_S: Final = np.arange(-50, 1700) / 50.0
FLOWN_M: Final = np.where(TIME_S > 0.5, 3.0 - 3.0 * np.exp(-(TIME_S - 0.5)) * np.cos(TIME_S - 0.5), 0.0)


def expected_of(experiment: str = "takeoff") -> ExpectedFlight:
    expected = get_experiment(experiment).expected
    assert expected is not None
    return expected


def record(altitude: Samples = FLOWN_M, time_s: Samples = TIME_S) -> Trajectory:
    return Trajectory(time_s, {"altitude_m": altitude}, "csv", "vehicle")


def codes(flown: Trajectory, expected: ExpectedFlight | None = None) -> set[str]:
    return {found.code.value for found in find_implausible(expected or expected_of(), flown)}


NOISE_M = 0.05 * np.sin(40.0 * TIME_S)
PLAUSIBLE = {
    "a takeoff": record(),
    "without samples before the command": record(FLOWN_M[50:], TIME_S[50:]),
    "from 20 s before the command": record(np.append(np.zeros(950), FLOWN_M), np.arange(-1000, 1700) / 50.0),
    "from a datum 0.2 m higher": record(FLOWN_M - 0.2),
    "with noise": record(FLOWN_M + NOISE_M),
    "with a bad barometer's noise": record(FLOWN_M + 4.0 * NOISE_M),
    "with an overshoot to 6 m": record(FLOWN_M + 3.0 * np.exp(-((TIME_S - 4.0) ** 2))),
    "that swings by 2 m for ever": record(FLOWN_M * (1.0 + 0.7 * np.sin(2.0 * TIME_S))),
    "that stays 1 m too low": record(FLOWN_M * 2.0 / 3.0),
    "that crashes after 10 s": record(np.where(TIME_S < 10.0, FLOWN_M, 0.0)),
    "with steps of 0.1 m": record(np.rint(10.0 * FLOWN_M) / 10.0),
}


@pytest.mark.parametrize("name", PLAUSIBLE)
def test_a_flight_to_the_height_is_plausible_however_badly_it_is_tuned(name: str) -> None:
    assert find_implausible(expected_of(), PLAUSIBLE[name]) == ()


@pytest.mark.parametrize("file", sorted(TAKEOFFS.glob("*.csv")), ids=lambda file: file.stem)
def test_a_recorded_takeoff_is_plausible(file: Path) -> None:
    assert find_implausible(expected_of(), read_takeoff_csv(file.read_bytes())) == ()


IMPLAUSIBLE = {
    "constant 3 m": (record(np.full_like(TIME_S, 3.0)), {"constant", "off ground", "too low"}),
    "the set point from the command on": (record(np.where(TIME_S >= 0.0, 3.0, 0.0)), {"constant"}),
    "never took off": (record(np.zeros_like(TIME_S)), {"constant", "too low"}),
    "never took off, a barometer's noise": (record(NOISE_M), {"too low"}),
    "never took off, with a glitch": (record(np.where(np.abs(TIME_S - 5.0) < 0.1, 9.0, NOISE_M)), {"too low"}),
    "begins in hover": (record(3.0 + NOISE_M), {"off ground", "too low"}),
    "begins in hover, then lands": (record(FLOWN_M[::-1].copy()), {"off ground", "too low"}),
    "begins within the climb": (record(FLOWN_M[100:], TIME_S[50:-50]), {"off ground"}),
    "climbs before the command": (record(FLOWN_M[100:], TIME_S[:-100]), {"off ground", "moving", "too low"}),
    "flown to 1 m": (record(FLOWN_M / 3.0), {"too low"}),
    "flown to 5 m": (record(FLOWN_M * 5.0 / 3.0), {"too high"}),
    "from a table to 3 m": (record(np.maximum(FLOWN_M, 0.5)), {"off ground"}),
}


@pytest.mark.parametrize("name", IMPLAUSIBLE)
def test_what_shows_no_takeoff_is_found_and_not_read_otherwise(name: str) -> None:
    flown, found = IMPLAUSIBLE[name]
    assert codes(flown) == found
    assert find_readings(expected_of(), flown) == ()


READABLE: Final = {
    "centimetres": record(100.0 * FLOWN_M),
    "millimetres": record(1000.0 * FLOWN_M),
    "feet": record(FLOWN_M / 0.3048),
    "down-positive": record(-FLOWN_M),
    "other-datum": record(FLOWN_M + 432.1),
    "milliseconds": record(time_s=1e3 * TIME_S),
    "microseconds": record(time_s=1e6 * TIME_S),
    "feet other-datum": record((FLOWN_M + 432.1) / 0.3048),
    "centimetres other-datum": record(100.0 * (FLOWN_M - 60.0)),
    "down-positive other-datum": record(-FLOWN_M - 12.0),
    "milliseconds millimetres": record(1000.0 * FLOWN_M, 1e3 * TIME_S),
    "microseconds feet down-positive other-datum": record((-FLOWN_M - 7.0) / 0.3048, 1e6 * TIME_S),
}


@pytest.mark.parametrize("name", READABLE)
def test_a_takeoff_in_another_unit_sign_or_datum_is_recognised_and_read(name: str) -> None:
    found = find_readings(expected_of(), READABLE[name])
    assert " ".join(found) == name
    read = read_as(READABLE[name], found)
    np.testing.assert_allclose(read.time_s, TIME_S, atol=1e-9)
    np.testing.assert_allclose(read["altitude_m"], FLOWN_M, atol=1e-9)
    assert read.source == f"csv; read with {', '.join(reading.words for reading in found)}"


@pytest.mark.parametrize("shift_m", [0.4, -0.4, 1.5, -2.0, 4000.0])
def test_an_offset_of_the_whole_record_is_another_datum(shift_m: float) -> None:
    assert find_readings(expected_of(), record(FLOWN_M + shift_m)) == (Reading.OTHER_DATUM,)


@pytest.mark.parametrize("rate_hz", [4.0, 5.0, 50.0, 10_000.0])
def test_milliseconds_are_recognised_at_every_rate_that_can_be_scored(rate_hz: float) -> None:
    time_s = np.arange(-1.0, 33.5, 1.0 / rate_hz)
    flown = record(np.interp(time_s, TIME_S, FLOWN_M), 1e3 * time_s)
    assert find_readings(expected_of(), flown) == (Reading.MILLISECONDS,)


def test_a_record_with_a_gap_is_not_read_otherwise() -> None:
    kept = (TIME_S < 12.0) | (TIME_S > 14.0)
    assert find_readings(expected_of(), record(100.0 * FLOWN_M[kept], TIME_S[kept])) == ()
    assert find_readings(expected_of(), record(FLOWN_M[kept], TIME_S[kept])) == ()


def test_every_length_and_speed_is_read_and_nothing_else() -> None:
    channels = {
        "altitude_m": 100.0 * FLOWN_M + 50.0,
        "set_point_m": np.where(TIME_S >= 0.0, 300.0, 0.0),
        "climb_rate_m_s": np.full_like(TIME_S, 80.0),
        "battery_v": np.full_like(TIME_S, 11.1),
    }
    read = read_as(replace(record(), channels=channels), [Reading.CENTIMETRES, Reading.OTHER_DATUM])
    ends = {name: values[[0, -1]].tolist() for name, values in read.channels.items()}
    assert ends["altitude_m"] == pytest.approx([0.0, FLOWN_M[-1]])
    assert (ends["set_point_m"], ends["climb_rate_m_s"], ends["battery_v"]) == ([0.0, 3.0], [0.8, 0.8], [11.1, 11.1])


def steps_flown(expected: ExpectedFlight, begin_s: float) -> Trajectory:
    time_s = np.arange(begin_s, expected.end_s + 1.0, 0.02)
    late = expected.set_point(time_s - 0.5)
    return record(np.convolve(np.pad(late, 25, mode="edge"), np.full(51, 1.0 / 51.0), mode="valid"), time_s)


STEPS = sorted(name for name in EXPERIMENTS if "steps" in name)


@pytest.mark.parametrize("experiment", STEPS)
@pytest.mark.parametrize("begin_s", [-1.0, 4.0])
def test_steps_may_begin_in_hover(experiment: str, begin_s: float) -> None:
    expected = expected_of(experiment)
    flown = steps_flown(expected, begin_s)
    assert find_implausible(expected, flown) == ()
    hover = replace(flown, channels={"altitude_m": np.full_like(flown.time_s, 3.0)})
    assert codes(hover, expected) == {"constant"}
    feet = replace(flown, channels={"altitude_m": -flown["altitude_m"] / 0.3048})
    assert find_readings(expected, feet) == (Reading.FEET, Reading.DOWN_POSITIVE)
    landed = replace(flown, channels={"altitude_m": 0.01 * flown["altitude_m"]})
    assert codes(landed, expected) == {Implausible.TOO_LOW.value}


def test_only_flights_to_a_height_are_checked() -> None:
    checked = {name for name in EXPERIMENTS if get_experiment(name).expected is not None}
    assert checked == set(EXPERIMENTS) - {"pitch-tracking"}


def test_a_finding_is_a_sentence_with_its_value_and_limit() -> None:
    (found,) = find_implausible(expected_of(), record(FLOWN_M - 0.4))
    assert found.sentence == "it begins at −0.40 m, not within 0.3 m of the ground"


def test_a_record_that_is_read_as_it_is_stays_the_same() -> None:
    flown = record()
    assert read_as(flown, ()) is flown


def test_a_record_without_samples_where_it_is_scored_is_left_to_scoring() -> None:
    assert find_implausible(expected_of(), record(FLOWN_M[:40], TIME_S[:40])) == ()
