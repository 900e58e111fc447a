"""A trial in every state, brought there by the same steps as in life."""

from fastapi.testclient import TestClient

from app.common.states import TrialState
from app.db.models import VehicleRow
from app.db.session import Database
from app.flights import flight_rows
from tests.builders import (
    Json,
    create_ready_campaign,
    create_record,
    create_trial,
    land,
    lift_off,
    made_once,
    stage,
)


def make_vehicle_real(database: Database, kind: str = "twin") -> None:
    """From now on this kind counts as a real aircraft."""
    with database.write() as session:
        session.query(VehicleRow).filter(VehicleRow.kind == kind).one().is_real = True


def create_trial_in(state: TrialState, client: TestClient, database: Database) -> Json:
    """A trial of a new campaign on the twin, in that state; its class is the program's wherever it may be."""
    return made_once(database, f"a trial that is {state}", lambda: _create_trial_in(state, client, database))


def _create_trial_in(state: TrialState, client: TestClient, database: Database) -> Json:
    campaign = create_ready_campaign(client, database)
    if state in {TrialState.PLANNED, TrialState.CANCELLED}:
        trial = create_trial(client, campaign["id"])
    else:
        trial = create_trial(client, campaign["id"], fly={"speed": None})
        _fly(state, database)
    if state == TrialState.CANCELLED:
        client.post(f"/api/trials/{trial['id']}/cancel")
    found: Json = client.get(f"/api/trials/{trial['id']}").json()
    assert found["state"] == state
    return found


def _fly(state: TrialState, database: Database) -> None:
    if state == TrialState.STAGED:
        stage(database)
        return
    if state == TrialState.CAPTURED:
        make_vehicle_real(database)
    task = lift_off(database)
    match state:
        case TrialState.LOST:
            with database.write() as session:
                flight_rows.lose_running_flights(session)
        case TrialState.ABORTED:
            land(database, task, create_record(ending="aborted", reason="by hand", until_s=4.0))
        case TrialState.INVALID:
            land(database, task, create_record(until_s=20.0))
        case TrialState.VALID | TrialState.CAPTURED:
            land(database, task, create_record())
        case _:
            assert state == TrialState.FLYING
