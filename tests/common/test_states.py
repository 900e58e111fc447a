"""Every pair of states of every machine, against the lists of the domain."""

from collections.abc import Mapping
from enum import StrEnum
from itertools import product
from typing import Any

import pytest

from app.common import states
from app.common.conflict_checks import allowed, check_action, check_transition, check_version
from app.common.errors import ConflictError

# What the domain allows, written apart from the program's tables: "from: to, to". Back from flying to planned is
# docs/decisions/0020.
TRIAL = """
planned: staged, cancelled, captured
staged: flying, planned, cancelled
flying: captured, aborted, lost, planned
captured: valid, aborted, invalid
valid: invalid
aborted: invalid
invalid: valid, aborted
lost: captured, invalid
cancelled:
"""
CAMPAIGN = """
draft: ready
ready: flying
flying: deciding
deciding: flying, finished
finished: deciding, archived
archived:
"""
JOB = """
queued: running, cancelled
running: done, failed, cancelled, queued
done:
failed: queued
cancelled: queued
"""
FLIGHT = """
requested: running, cancelled
running: landed, aborted, failed, lost, cancelled
landed:
aborted:
failed:
lost:
cancelled:
"""
VEHICLE = """
disconnected: ready, quarantined
ready: staged, disconnected, quarantined
staged: flying, ready, quarantined
flying: ready, quarantined
quarantined: ready, disconnected
"""
ACT = """
requested: running, failed
running: done, failed
done:
failed:
"""

Moves = Mapping[Any, frozenset[Any]]
MACHINES: dict[str, tuple[Moves, str]] = {
    "trial": (states.TRIAL_TRANSITIONS, TRIAL),
    "campaign": (states.CAMPAIGN_TRANSITIONS, CAMPAIGN),
    "job": (states.JOB_TRANSITIONS, JOB),
    "flight": (states.FLIGHT_TRANSITIONS, FLIGHT),
    "vehicle": (states.VEHICLE_TRANSITIONS, VEHICLE),
    "act": (states.ACT_TRANSITIONS, ACT),
}


def listed(text: str) -> set[tuple[str, str]]:
    lines = [line.split(":") for line in text.strip().splitlines()]
    return {(start, to.strip()) for start, ends in lines for to in ends.split(",") if to.strip()}


PAIRS = [(name, start, to) for name, (moves, _) in MACHINES.items() for start, to in product(moves, repeat=2)]


@pytest.mark.parametrize(("machine", "start", "to"), PAIRS)
def test_only_the_moves_of_the_domain_exist(machine: str, start: StrEnum, to: StrEnum) -> None:
    moves, text = MACHINES[machine]
    if (start.value, to.value) in listed(text):
        assert check_transition(moves, start, to, "It") == to
    else:
        with pytest.raises(ConflictError, match=r"^It is .* and cannot change to “"):
            check_transition(moves, start, to, "It")


@pytest.mark.parametrize("machine", MACHINES)
def test_every_state_has_its_line_in_the_table(machine: str) -> None:
    moves, text = MACHINES[machine]
    assert set(moves) == set(type(next(iter(moves))).__members__.values())
    assert {line.split(":")[0] for line in text.strip().splitlines()} == {state.value for state in moves}


@pytest.mark.parametrize(
    "kind",
    [
        states.TrialState,
        states.FlightState,
        states.CampaignState,
        states.JobState,
        states.VehicleState,
        states.ActState,
    ],
)
def test_every_lifecycle_is_drawn_in_its_docstring(kind: type[StrEnum]) -> None:
    assert kind.__doc__ is not None
    missing = [state.value for state in kind if state.value not in kind.__doc__.lower()]
    assert not missing


def test_a_refused_action_states_when_it_is_possible() -> None:
    with pytest.raises(ConflictError, match="only while it is cancelled or failed"):
        check_action(states.JOB_ACTIONS, "retry", states.JobState.DONE, "Job 1")
    assert allowed(states.JOB_ACTIONS, states.JobState.RUNNING) == ["cancel"]


def test_an_edit_of_an_outdated_version_names_what_changed() -> None:
    check_version(3, 3, "It", {})
    with pytest.raises(ConflictError) as caught:
        check_version(2, 3, "It", {"name": ("new", "mine"), "note": ("same", "same")})
    assert [problem.field for problem in caught.value.problems] == ["version", "name"]
    assert caught.value.problems[1].reason == "is now “new”; you entered “mine”"
