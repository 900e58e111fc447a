"""Ends of flights in the words of earlier versions: recognised as codes, and told in the same words again."""

import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from alembic import command
from alembic.config import Config

from app.db.base import FLIGHT_END
from app.db.earlier_ends import give_end, read_end
from app.db.session import open_engine
from app.vehicles.flight_end import end_text

LINK = (
    "The link was lost in flight. Land was repeated; without a link only the vehicle's own failsafe or flight plan "
    "lands it."
)
ON_GROUND = "It restored the safe gains before the takeoff. Request the flight again if it is still needed."

FAILURES_0_3_0 = {
    "No heartbeat was received; nothing was sent.": "F1",
    "The vehicle did not confirm its gains; it was not armed.": "F2",
    "The vehicle did not arm.": "F3",
    "The vehicle did not lift off.": "F4a",
    LINK: "F5",
    "A safety limit was exceeded.": "F6",
    "The vehicle's position froze while packets still arrived.": "F9a",
    "Too many samples had to be dropped.": "F9b",
    "Two sources of altitude disagree.": "F9c",
    "The vehicle's position was lost.": "F9d",
    "The vehicle's clock is slower than the clock speed in its settings.": "F9e",
    "A pilot took manual control; no further commands were sent.": "F10a",
    "The vehicle changed its state without a command. It was commanded to land; its motors were not stopped.": "F10b",
    "The flight may have been interrupted.": "F10c",
    "The vehicle began to land by itself.": "F11",
    "Two vehicles use the same system id. Both were commanded to land; their motors were not stopped.": "F12",
    "The vehicle fell.": "F13",
    "The vehicle did not confirm a new set point.": "F14a",
    "The steps were not flown.": "F14b",
    "The set points paused.": "F14c",
}
TOLD = [
    ("", None, None),
    ("A safety limit was exceeded. It rose to 4.6 m.", "F6", None),
    (f"{LINK} Nothing was received for more than 1 s.", "F5", None),
    ("A pilot took manual control; no further commands were sent. The vehicle entered mode 0.", "F10a", None),
    ("aborted by the operator", "F8", "operator"),
    ("Motors off was requested by the operator.", "F8", "operator"),
    ("Motors off was requested: people below. The vehicle confirmed that its motors have stopped.", "F8", "operator"),
    ("aborted before lift-off: somebody walked in", "F8", "operator"),
    ("aborted before lift-off by the operator", "F8", "operator"),
    ("ended before lift-off: The vehicle fell.", "F13", None),
    ("Gainline was stopped", "F8", "program stopped"),
    ("Gainline was stopped. It landed the vehicle and restored the safe gains.", "F8", "program stopped"),
    (f"Gainline was stopped. {ON_GROUND}", "F8", "program stopped"),
    ("unstaged from another browser", None, "another browser"),
    ("The gust was strong.", None, None),
]


def codes(end: dict[str, Any]) -> tuple[str | None, str | None]:
    return end["failure"], None if end["request"] is None else end["request"]["by"]


@pytest.mark.parametrize(("told", "failure", "by"), TOLD)
def test_words_of_0_3_0_are_recognised_and_told_again(told: str, failure: str | None, by: str | None) -> None:
    landed = "stayed" if "before the takeoff" in told else "landed"
    end = read_end(told, landed=landed)
    assert codes(end) == (failure, by)
    assert end_text(FLIGHT_END.validate_python(end)) == told


@pytest.mark.parametrize(
    ("told", "failure", "by"),
    [
        ("A safety limit was met. It rose to 4.6 m.", "F6", None),
        ("Somebody took the vehicle over by hand; it was left alone.", "F10a", None),
        ("Motors off was asked for: people below.", "F8", "operator"),
        ("the worker was stopped (SIGTERM)", "F8", "program stopped"),
        ("aborted by the operator", "F8", "operator"),
    ],
)
def test_words_of_0_2_0_are_recognised(told: str, failure: str, by: str | None) -> None:
    assert codes(read_end(told)) == (failure, by)


def test_every_sentence_of_0_3_0_is_recognised() -> None:
    """Written here as that version had them: a changed sentence must still be recognised."""
    assert {text: read_end(text)["failure"] for text in FAILURES_0_3_0} == FAILURES_0_3_0


def test_the_words_of_a_person_stay_with_the_trial() -> None:
    trial = {"state": "invalid", "reason": "gust", "abort_cause": None, "settings": {"landed": False}}
    give_end(trial)
    assert trial["reason"] == "gust"
    assert trial["end"] == read_end("", landed="unknown")


TRIAL = (
    "INSERT INTO trial (id, version, campaign_id, number, state, kind, gains, gate, ending, abort_cause, settings,"
    " reason, note, overrule_reason, seed, created_at, error) VALUES (?, 1, 1, ?, ?, 'manual', '{}', '{}', ?, ?, ?, ?,"
    " '', '', 1, '2026-11-20 10:00:00', 0.1)"
)
FLIGHT = (
    "INSERT INTO flight (id, campaign_id, trial_id, vehicle_id, state, mode, gains, stand_down, safe_gains, restored,"
    " battery, problem, requested_at) VALUES (?, 1, ?, 1, ?, 'stage', '{}', ?, '{\"kp\": 1}', ?, '', ?,"
    " '2026-11-20 10:00:00')"
)
LIMIT = "A safety limit was exceeded. It rose to 4.6 m."
TRIALS = [
    (1, 1, "aborted", "aborted", "limit", "{}", LIMIT),
    (2, 2, "aborted", "aborted", "operator", '{"landed": false}', "people below"),
    (3, 3, "invalid", "aborted", "operator", "{}", "gust"),
    (4, 4, "planned", None, None, "{}", "unstaged by the operator"),
    (5, 5, "captured", "invalid", None, "{}", "A pilot took manual control; no further commands were sent. Mode 0."),
    (6, 6, "aborted", "aborted", "something else", "{}", "Gainline was stopped"),
    (7, 7, "valid", "completed", None, "{}", "a clean flight"),
]
SAFE, OTHER = '{"kp": 1}', '{"kp": 2}'
FLIGHTS = [
    (1, 1, "aborted", "", SAFE, LIMIT),
    (2, 2, "aborted", "", OTHER, "people below"),
    (3, 3, "aborted", "", SAFE, "aborted by the operator"),
    (4, 4, "cancelled", "unstaged by the operator", SAFE, "unstaged by the operator"),
    (5, 5, "landed", "", None, "A pilot took manual control; no further commands were sent. Mode 0."),
    (6, 6, "aborted", "", None, "Gainline was stopped"),
    (7, 7, "landed", "", SAFE, ""),
]


def test_rows_of_before_get_codes_and_on_the_way_back_their_remarks(migrated_file: Path, tmp_path: Path) -> None:
    file = tmp_path / "gainline.sqlite3"
    file.write_bytes(migrated_file.read_bytes())
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parents[2] / "migrations"))
    with open_engine(file, foreign_keys=False).connect() as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, "0009")
        for statement, rows in ((TRIAL, TRIALS), (FLIGHT, FLIGHTS)):
            for row in rows:
                connection.exec_driver_sql(statement, row)
        command.upgrade(config, "0010")
        connection.commit()
        trials = connection.exec_driver_sql('SELECT id, reason, "end" FROM trial ORDER BY id').fetchall()
        flights = connection.exec_driver_sql('SELECT id, stand_down, "end" FROM flight ORDER BY id').fetchall()
        command.downgrade(config, "0009")
        connection.commit()
    ends = {row[0]: json.loads(row[2]) for row in trials}
    assert {number: codes(end) for number, end in ends.items()} == {
        1: ("F6", None),
        2: ("F8", "operator"),
        3: ("F8", "operator"),
        4: (None, "operator"),
        5: ("F10a", None),
        6: ("F8", "program stopped"),
        7: (None, None),
    }
    assert [row[1] for row in trials] == ["", "", "gust", "", "", "", "a clean flight"]
    assert [end["landed"] for end in ends.values()] == [
        *("landed", "unknown", "landed", "stayed", "landed", "landed", "landed")
    ]
    left = {row[0]: json.loads(row[2])["gains_left"] for row in flights}
    assert left == {1: "safe", 2: "other", 3: "safe", 4: "safe", 5: "flight", 6: "unknown", 7: "safe"}
    assert [row[1] for row in flights if row[1]] == ["operator"]
    with sqlite3.connect(file) as again:
        problems = [row[0] for row in again.execute("SELECT problem FROM flight ORDER BY id")]
        reasons = [row[0] for row in again.execute("SELECT reason FROM trial ORDER BY id")]
    again.close()
    assert problems == ["It rose to 4.6 m.", "", "", "", "Mode 0.", "", ""]
    assert reasons == ["It rose to 4.6 m.", "", "gust", "", "Mode 0.", "", "a clean flight"]
