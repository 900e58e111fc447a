"""Paparazzi's ground logs, written from takeoffs of the exact replica."""

import io

import pytest

from app.core.errors import TrajectoryError
from app.logs.readers import read_takeoff, read_takeoffs
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of
from tests.vehicles.flying import TAKEOFF

DEFAULT = {"kp": 283, "ki": 13, "kd": 82}
TUNED = {"kp": 1624, "ki": 1356, "kd": 195}


def stream(text: str) -> io.BytesIO:
    return io.BytesIO(text.encode())


def test_the_loop_s_own_message_tells_everything() -> None:
    flown = read_takeoff(stream(data_of(Flight(DEFAULT))), companion=stream(COMPANION))
    assert flown.gains == DEFAULT
    assert flown.begins_with == "the reference starting to move"
    assert set(flown.trajectory.channels) == {
        "altitude_m", "climb_rate_m_s", "set_point_m", "reference_m", "thrust", "feed_forward", "feedback",
    }  # fmt: skip
    assert flown.trajectory["altitude_m"][0] == pytest.approx(0.1, abs=1 / 256)
    assert flown.trajectory["set_point_m"][-1] == 3.0
    assert flown.trajectory["thrust"].max() <= 1.0
    assert TAKEOFF.error(flown.trajectory) == pytest.approx(0.3215, abs=0.0005)


def test_without_its_companion_the_gains_are_those_that_the_commands_follow_from() -> None:
    flown = read_takeoff(stream(data_of(Flight(TUNED))))
    assert flown.gains == TUNED
    assert "gains computed from the loop's commands" in flown.notes


def test_settings_that_the_vehicle_reported_win_over_those_built_in() -> None:
    flown = read_takeoff(stream(data_of(Flight(TUNED, setting=True, loop_log=False))), companion=stream(COMPANION))
    assert flown.gains == TUNED


def test_the_position_message_alone_gives_altitude_and_lift_off() -> None:
    flown = read_takeoff(stream(data_of(Flight(DEFAULT, loop_log=False))), companion=stream(COMPANION))
    whole = read_takeoff(stream(data_of(Flight(DEFAULT))))
    assert (flown.begins_with, flown.gains) == ("lift-off", DEFAULT)
    assert set(flown.trajectory.channels) == {"altitude_m", "climb_rate_m_s"}
    assert TAKEOFF.error(flown.trajectory) == pytest.approx(TAKEOFF.error(whole.trajectory), abs=0.02)


def test_where_the_position_comes_more_often_than_the_loop_its_altitude_is_taken() -> None:
    lines = data_of(Flight(DEFAULT, every=10)).splitlines()
    rare = [line for number, line in enumerate(lines) if "VERT_LOOP" not in line or number % 20 == 2]
    flown = read_takeoff(stream("\n".join(rare)))
    assert flown.begins_with == "the reference starting to move"
    assert len(flown.trajectory) > 1700
    assert "reference_m" in flown.trajectory.channels


def test_another_set_point_ends_the_record() -> None:
    lines = data_of(Flight(DEFAULT, fly_s=20.0)).splitlines()
    later = next(number for number, line in enumerate(lines) if line.startswith("27."))
    landing = [line.replace("VERT_LOOP -768", "VERT_LOOP -128") for line in lines[later:]]
    flown = read_takeoff(stream("\n".join(lines[:later] + landing)))
    assert flown.trajectory.time_s[-1] == pytest.approx(12.0, abs=0.1)
    assert any("the set point becoming 0.5 m" in note for note in flown.notes)


def test_other_aircraft_and_other_messages_are_left_out() -> None:
    mixed = []
    for line in data_of(Flight(DEFAULT, fly_s=6.0)).splitlines():
        mixed += [line, line.replace(" 31 ", " 32 "), "garbage", line.split("VERT")[0] + "ATTITUDE 0 0 0"]
    flown = read_takeoff(stream("\n".join(mixed)))
    assert "other aircraft in the log left out: 32" in flown.notes


@pytest.mark.parametrize(
    ("companion", "reason"),
    [
        ("<configuration>", "companion file that is not XML"),
        ("not xml", "companion file that is not XML"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><x>&a;</x>', "it declares entities"),
    ],
)
def test_a_companion_that_is_none_is_refused(companion: str, reason: str) -> None:
    with pytest.raises(TrajectoryError, match=reason):
        read_takeoff(stream(data_of(Flight(DEFAULT, fly_s=6.0))), companion=stream(companion))


@pytest.mark.parametrize(
    "line",
    [
        "VERT_LOOP -768 0 0",
        "VERT_LOOP " + " ".join(["99999999999"] * 15),
        "VERT_LOOP " + " ".join(["1.5"] * 15),
        "ROTORCRAFT_FP a b c d e f",
        "DL_VALUE 1 x",
    ],
)
def test_lines_that_cannot_be_are_passed_over(line: str) -> None:
    text = data_of(Flight(DEFAULT, fly_s=6.0))
    flown = read_takeoff(stream(f"{text}20.0 31 {line}\n"))
    assert len(flown.trajectory) == len(read_takeoff(stream(text)).trajectory)


def test_a_file_without_any_altitude_is_refused() -> None:
    with pytest.raises(TrajectoryError, match="contains neither VERT_LOOP nor ROTORCRAFT_FP"):
        read_takeoffs(stream("1.0 31 ALIVE 1,2\n" * 100))
