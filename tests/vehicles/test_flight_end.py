"""The sentences about the end of a flight, made from its codes."""

import pytest

from app.vehicles.flight_end import (
    FAILURE_TEXTS,
    Failure,
    FlightEnd,
    GainsLeft,
    Landing,
    Requester,
    StopRequest,
    cause_text,
    end_text,
    not_begun,
    requested,
)

STOPPED = StopRequest(by=Requester.PROGRAM_STOPPED)
LIMIT = FlightEnd(failure=Failure.ENVELOPE, remarks=("It rose to 4.6 m.",))
RESTORED = "It landed the vehicle and restored the safe gains."


def aborted(
    request: StopRequest,
    *remarks: str,
    landed: Landing = Landing.LANDED,
    gains_left: GainsLeft = GainsLeft.UNKNOWN,
) -> FlightEnd:
    return FlightEnd(failure=Failure.OPERATOR, request=request, remarks=remarks, landed=landed, gains_left=gains_left)


@pytest.mark.parametrize(
    ("end", "told"),
    [
        (FlightEnd(), ""),
        (FlightEnd(remarks=("2 samples jumped and were dropped.",)), "2 samples jumped and were dropped."),
        (FlightEnd(failure=Failure.NO_HEARTBEAT), "No heartbeat was received; nothing was sent."),
        (FlightEnd(failure=Failure.NOT_ARMED), "The vehicle did not arm."),
        (LIMIT, "A safety limit was exceeded. It rose to 4.6 m."),
        (FlightEnd(failure=Failure.BATTERY, remarks=("It was 9.0 V.",)), "It was 9.0 V."),
        (aborted(StopRequest()), "aborted by the operator"),
        (aborted(StopRequest("too close"), "It fell."), "too close It fell."),
        (aborted(StopRequest(motors_off=True)), "Motors off was requested by the operator."),
        (aborted(StopRequest("hot", motors_off=True)), "Motors off was requested: hot."),
        (aborted(STOPPED), "Gainline was stopped"),
        (aborted(STOPPED, gains_left=GainsLeft.SAFE), f"Gainline was stopped. {RESTORED}"),
        (aborted(StopRequest(by=Requester.WORKER_EXITED)), "the worker has exited"),
        (aborted(StopRequest(), landed=Landing.STAYED), "aborted before lift-off by the operator"),
        (aborted(StopRequest("no"), landed=Landing.STAYED), "aborted before lift-off: no"),
        (FlightEnd(failure=Failure.FALL, landed=Landing.STAYED), "ended before lift-off: The vehicle fell."),
        (FlightEnd(request=StopRequest(), landed=Landing.STAYED), "unstaged by the operator"),
        (FlightEnd(request=StopRequest(by=Requester.SCRIPT), landed=Landing.STAYED), "unstaged by a script"),
        (not_begun("no worker ran"), "no worker ran"),
    ],
)
def test_the_end_of_a_flight_is_told(end: FlightEnd, told: str) -> None:
    assert end_text(end) == told


def test_a_request_without_words_continues_the_word_for_the_state() -> None:
    assert cause_text(aborted(StopRequest()), "Aborted") == "Aborted by the operator"
    assert cause_text(aborted(StopRequest("too close")), "Aborted") == "too close"


def test_every_failure_has_its_sentence_but_those_that_their_remarks_explain() -> None:
    assert set(Failure) - FAILURE_TEXTS.keys() == {Failure.OPERATOR, Failure.BATTERY}


def test_what_was_requested_is_told_with_or_without_words() -> None:
    assert requested("Land", "") == "Land was requested by the operator."
    assert requested("Land", "it drifts") == "Land was requested: it drifts."
