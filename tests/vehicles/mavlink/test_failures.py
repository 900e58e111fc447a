from pathlib import Path

import pytest

from app.vehicles.mavlink.failures import RESPONSES, Failure

PAGE = (Path(__file__).parents[3] / "docs" / "real-flight.md").read_text(encoding="utf-8")


def test_every_failure_has_its_response() -> None:
    assert list(RESPONSES) == list(Failure)


def test_only_a_safety_limit_and_a_person_speak_against_the_gains_which_are_suspect_also_if_it_did_not_settle() -> None:
    suspect = {failure for failure, known in RESPONSES.items() if known.reaction == "land, gains first"}
    assert suspect == {Failure.ENVELOPE, Failure.OPERATOR, Failure.NOT_SETTLED}
    aborting = {failure for failure in suspect if RESPONSES[failure].outcome == "aborted"}
    assert aborting == {Failure.ENVELOPE, Failure.OPERATOR}


def test_a_bad_measurement_never_counts_as_a_safety_limit() -> None:
    for failure in (Failure.LINK, Failure.FROZEN, Failure.GLITCHES, Failure.DISAGREEMENT, Failure.BATTERY):
        assert RESPONSES[failure].outcome == "invalid"


@pytest.mark.parametrize("failure", Failure)
def test_every_failure_is_described_for_the_operator(failure: Failure) -> None:
    row = next(line for line in PAGE.splitlines() if line.startswith(f"| {failure} |"))
    _, _, condition, reaction, outcome, advice, _ = (cell.strip() for cell in row.split("|"))
    assert condition
    assert advice
    assert reaction.startswith(RESPONSES[failure].reaction) or RESPONSES[failure].reaction == "none"
    assert RESPONSES[failure].outcome in outcome
