"""Paparazzi's ground logs, written from takeoffs of the exact replica."""

import io
import re
from collections.abc import Callable, Mapping, Sequence

import pytest

from app.autopilots.log_readers import read_takeoff, read_takeoffs
from app.autopilots.takeoffs import Takeoff
from app.core.errors import TrajectoryError
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of
from tests.logs.recorded import recorded
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


SECOND = {"kp": 3981, "ki": 1073, "kd": 409}


def recorded_log(companion: bytes | None = None, *, loop_log: bool = True) -> Sequence[Takeoff]:
    """The takeoffs of the recorded log with this companion, by default its own; without VERT_LOOP if asked."""
    data = recorded("paparazzi_steps.data")
    if not loop_log:
        rest = [line for line in data.splitlines() if b"VERT_LOOP" not in line]
        data = b"\n".join([b"0.1 7 DL_VALUE 16 1.", *rest])  # of another aircraft
    beside = recorded("paparazzi_steps.log") if companion is None else companion
    return read_takeoffs(io.BytesIO(data), companion=io.BytesIO(beside))


def test_a_recorded_log_has_the_gains_of_every_flight() -> None:
    """Between the second and the third flight the safe gains were written back, and reported; kp was not."""
    takeoffs = recorded_log()
    assert [each.gains for each in takeoffs] == [DEFAULT, SECOND, SECOND]
    assert all("with the set point becoming 2 m" in each.notes[-1] for each in takeoffs)
    assert [len(each.notes) for each in takeoffs] == [1, 1, 1]


@pytest.mark.parametrize(
    ("companion", "note"),
    [
        (COMPANION.encode(), "gains computed from the loop's commands"),
        (COMPANION.replace('ac_id="31"', 'ac_id="7"').encode(), "the .log file does not describe this aircraft"),
    ],
    ids=["of another log", "of another aircraft"],
)
def test_a_companion_that_belongs_to_another_log_changes_no_gains(companion: bytes, note: str) -> None:
    takeoffs = recorded_log(companion)
    assert [each.gains for each in takeoffs] == [DEFAULT, SECOND, SECOND]
    assert note in takeoffs[0].notes


def numbered(change: Callable[[str], str] = str, *, loop_log: bool = False) -> list[Mapping[str, float]]:
    """Gains of the recorded takeoffs without the loop's commands, with a changed companion."""
    companion = change(recorded("paparazzi_steps.log").decode())
    return [each.gains for each in recorded_log(companion.encode(), loop_log=loop_log)]


def test_without_the_loop_s_commands_gains_are_known_while_the_reports_agree() -> None:
    """Every gain is reported once in 38 s: those of the later flights are not certain."""
    assert numbered() == [DEFAULT, {}, {}]


def lower_case(text: str) -> str:
    return re.sub(r"\b([A-Z]+)=", lambda match: match[0].lower(), text)


@pytest.mark.parametrize(
    "change",
    [
        lower_case,
        lambda text: text.replace('VAR="guidance_v_k', 'VAR="guidance_v.gains_k'),
        lambda text: text.replace("<conf>", '<conf><aircraft ac_id="1"><define NAME="HOVER_KP" VALUE="9"/></aircraft>'),
    ],
    ids=["lower case", "known by their constants", "several aircraft"],
)
def test_the_numbers_are_found_however_the_settings_are_written(change: Callable[[str], str]) -> None:
    assert numbered(change)[0] == DEFAULT


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace('VALUE="283"', 'VALUE="284"'),
        lambda text: re.sub(r"<dl_setting VAR=.guidance_v_k.*", "", text),
        lambda text: re.sub(r'VALUE="(?:283|82|13)" NAME="HOVER_K', 'VALUE="0" NAME="HOVER_K', text),
    ],
    ids=["other gains built in", "no such settings", "gains that other settings have too"],
)
def test_numbers_that_are_not_certain_are_not_guessed(change: Callable[[str], str]) -> None:
    companion = change(recorded("paparazzi_steps.log").decode()).encode()
    flown = recorded_log(companion, loop_log=False)[0]
    assert flown.gains == {}
    assert "the .log file does not establish which settings the vehicle reported" in flown.notes
    assert recorded_log(companion)[0].gains == DEFAULT


def test_generated_settings_with_fewer_numbers_than_were_reported_are_of_another_program() -> None:
    generated = "<generated_settings><dl_settings><dl_setting var='x'/></dl_settings></generated_settings></aircraft>"
    assert numbered(lambda text: text.replace("</aircraft>", generated))[0] == DEFAULT
