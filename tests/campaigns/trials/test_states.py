"""What people and workers can do to a trial in each of its states, and that nothing else ever happens to it."""

from collections.abc import Callable
from contextlib import suppress

import pytest
from fastapi.testclient import TestClient
from sqlalchemy.orm import Session

from app.common.errors import ConflictError
from app.common.states import TRIAL_TRANSITIONS, TrialState
from app.db.models import TrialRow
from app.db.session import Database
from app.flights import flight_rows
from app.flights.flight_rows import FlightOutcome
from tests.builders import Json, create_csv, create_record, get, upload
from tests.campaigns.trials.states import create_trial_in

Act = Callable[[TestClient, Json], int]


def classify(outcome: str) -> Act:
    def act(client: TestClient, trial: Json) -> int:
        return client.post(
            f"/api/trials/{trial['id']}/classify",
            json={"version": trial["version"], "outcome": outcome, "reason": "looked at it"},
        ).status_code

    return act


def post(action: str) -> Act:
    return lambda client, trial: client.post(f"/api/trials/{trial['id']}/{action}").status_code


ACTS: dict[str, Act] = {
    "fly": post("fly"),
    "cancel": post("cancel"),
    "upload": lambda client, trial: upload(client, trial["id"], create_csv()).status_code,
    "class valid": classify("valid"),
    "class aborted": classify("aborted"),
    "class invalid": classify("invalid"),
}

# Act: state → the state after it. Whatever is not here is refused with 409 and changes nothing. The invalid trial's
# record ends too early to be scored, so it cannot be made valid (422).
POSSIBLE: dict[tuple[str, str], str] = {
    ("fly", "planned"): "planned",
    ("cancel", "planned"): "cancelled",
    ("cancel", "staged"): "cancelled",
    ("upload", "lost"): "valid",
    ("class valid", "captured"): "valid",
    ("class aborted", "captured"): "aborted",
    ("class aborted", "invalid"): "aborted",
    ("class invalid", "captured"): "invalid",
    ("class invalid", "valid"): "invalid",
    ("class invalid", "aborted"): "invalid",
    ("class invalid", "lost"): "invalid",
}


@pytest.mark.parametrize(("act", "start"), POSSIBLE)
def test_a_person_can_do_what_the_state_allows(client: TestClient, database: Database, act: str, start: str) -> None:
    trial = create_trial_in(TrialState(start), client, database)
    assert ACTS[act](client, trial) in {200, 201, 202}
    assert get(client, f"/api/trials/{trial['id']}")["state"] == POSSIBLE[act, start]


@pytest.mark.parametrize("state", TrialState)
def test_what_the_state_does_not_allow_is_neither_offered_nor_done(
    client: TestClient, database: Database, state: TrialState
) -> None:
    """A note can be written in every state. A refused act changes nothing, so that one trial serves all."""
    trial = create_trial_in(state, client, database)
    works = {act.split()[0].replace("class", "classify") for act, start in POSSIBLE if start == state}
    if state in {TrialState.STAGED, TrialState.FLYING}:
        works.add("abort")
    assert set(trial["actions"]) == works | {"note"}
    for act, do in ACTS.items():
        if (act, state.value) not in POSSIBLE:
            refused = 422 if (act, state) == ("class valid", TrialState.INVALID) else 409
            assert (do(client, trial), act) == (refused, act)
    assert get(client, f"/api/trials/{trial['id']}") == trial
    answer = client.patch(f"/api/trials/{trial['id']}", json={"version": trial["version"], "note": "windy"})
    assert (answer.status_code, answer.json()["note"], answer.json()["state"]) == (200, "windy", state)


Step = Callable[[Session, int], object]


def ends(outcome: FlightOutcome) -> Step:
    return lambda session, flight: flight_rows.record_outcome(session, flight, outcome)


STEPS: dict[str, Step] = {
    "staged": lambda session, flight: flight_rows.record_staged(session, flight, {"kp": 283, "ki": 13, "kd": 82}),
    "lift-off": flight_rows.record_lift_off,
    "landing": ends(FlightOutcome(record=create_record())),
    "short landing": ends(FlightOutcome(record=create_record(until_s=9.0))),
    "abort": ends(FlightOutcome(record=create_record(ending="aborted"))),
    "loss": ends(FlightOutcome(lifted_off=True, problem="gone")),
    "failure": ends(FlightOutcome(problem="refused")),
    "withdrawal": ends(FlightOutcome(withdrawn=True, problem="ended")),
    "restart": lambda session, _flight: flight_rows.lose_running_flights(session),
    "recovery": lambda session, flight: flight_rows.recover_record(session, flight, create_record()),
    "quarantine": ends(FlightOutcome(record=create_record(), concern="not verified")),
}


def reachable(start: TrialState) -> set[TrialState]:
    """By one move, or through `captured` to its class in one step."""
    one = set(TRIAL_TRANSITIONS[start])
    return {start} | one | (set(TRIAL_TRANSITIONS[TrialState.CAPTURED]) if TrialState.CAPTURED in one else set())


class UndoneError(Exception):
    """Ends a transaction as if it had not been."""


@pytest.mark.complete
@pytest.mark.parametrize(
    "state", [state for state in TrialState if state not in {TrialState.PLANNED, TrialState.CANCELLED}]
)
def test_no_step_of_a_worker_moves_a_trial_past_the_table(
    client: TestClient, database: Database, state: TrialState
) -> None:
    """Each step is undone, so that one trial serves all."""
    trial = create_trial_in(state, client, database)
    moved = {}
    for name, step in STEPS.items():
        with suppress(ConflictError, UndoneError), database.write() as session:
            step(session, trial["flight"]["id"])
            session.flush()
            moved[name] = session.get_one(TrialRow, trial["id"]).state
            raise UndoneError
        assert get(client, f"/api/trials/{trial['id']}") == trial
    assert set(moved.values()) <= reachable(state), moved
    assert bool(set(moved.values()) - {state}) == (state in {TrialState.STAGED, TrialState.FLYING, TrialState.LOST})
