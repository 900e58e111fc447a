"""Reasons of logs as codes with numbers, and what a person reads of them."""

from app.core.reasons import Reason, ReasonCode, refusal


def test_a_reason_is_data_and_a_sentence_about_its_field() -> None:
    reason = Reason(code=ReasonCode.MESSAGE_RARE, field="ATTITUDE_TARGET", numbers={"rate_hz": 4.0, "needed_hz": 17.0})
    found = reason.problem
    assert (found.field, found.code, found.numbers) == ("ATTITUDE_TARGET", "message_rare", reason.numbers)
    assert found.reason == "arrives 4.0 times a second; 17 times are needed"


def test_a_kind_of_vehicle_and_names_are_read_in_the_sentence() -> None:
    assert Reason(code=ReasonCode.NOT_A_COPTER, named=["helicopter"]).text == (
        "is that of a helicopter, not of a copter with several rotors"
    )
    assert Reason(code=ReasonCode.OTHER_MODES, named=["GUIDED", "LAND", "LOITER"]).text.startswith(
        "has no flight in GUIDED, the mode whose set points the messages give, only in LAND, LOITER"
    )


def test_filters_tell_the_seconds_that_each_takes() -> None:
    numbers = {"flown_s": 16.9, "held_s": 14.0, "left_out_by_leans_s": 12.0, "left_out_by_altitude_not_held_s": 2.9}
    balance = "of 16.9 s in the air 14.0 s are in a mode that holds altitude"
    assert Reason(code=ReasonCode.LEANS, field="ATT", numbers=numbers).text == (
        f"leans by more than 30° in too much of the flight; {balance}; "
        "left out: 12.0 s (leans), 2.9 s (altitude not held)"
    )
    short = Reason(code=ReasonCode.TOO_SHORT, numbers={"flown_s": 16.9, "held_s": 14.0, "needed_s": 4.0})
    assert short.text == f"leaves too short a time to analyse: 4 s are needed; {balance}"


def test_a_refusal_has_its_reasons_and_the_notes_of_the_log_once() -> None:
    reasons = [Reason(code=ReasonCode.NEVER_FLEW, field="EV"), Reason(code=ReasonCode.NO_DATA)]
    found = refusal("It cannot be analysed.", "Use another log.", reasons, ["9 bytes are damaged"])
    assert [(each.field, each.reason) for each in found.problems] == [
        ("EV", "has no flight: the vehicle never left the ground"),
        ("file", "has no data: copy the whole log; 9 bytes are damaged"),
    ]
