"""Registered vehicles over HTTP, and the steps of the worker that has their link, done by hand."""

from typing import Any

import httpx2

from app.common.states import TrialState, VehicleState
from app.db.models import TrialRow, VehicleRow
from app.db.session import Database
from app.fleet import commands
from app.vehicles.base import ConnectionOpened, Identity
from tests.builders import WORKER, Json, get, run_jobs
from tests.unlocking import unlock

DEFAULT_GAINS = {"kp": 283, "ki": 13, "kd": 82}
SEEN = {"safe_gains_confirmed": True, "statement": "Ada compared them with the airframe file"}
IDENTITY = Identity(system_id=1, autopilot="paparazzi", version="5.18")
OUR_PAGE = {"Sec-Fetch-Site": "same-origin"}


def register(client: httpx2.Client, name: str = "Drone", *, real: bool = False, **fields: object) -> Json:
    """One that is not connected yet. Who registers a real one has unlocked the browser."""
    if real:
        unlock(client)
    asked: dict[str, Any] = {"name": name, "kind": "mavlink", "options": {"simulated": not real}, **fields}
    answer = client.post("/api/vehicles", json={**(SEEN if real else {}), **asked})
    assert answer.status_code == 201, answer.text
    vehicle: Json = answer.json()
    return vehicle


def connect(client: httpx2.Client, database: Database, vehicle: Json, *, concern: str = "") -> Json:
    """As the worker does it; the vehicle as it is then."""
    answer = client.post(f"/api/vehicles/{vehicle['id']}/connect")
    assert answer.status_code == 202, answer.text
    with database.write() as session:
        task = commands.claim_act(session, WORKER)
        assert task is not None
        held = {} if concern else task.vehicle.safe_gains
        opened = ConnectionOpened(identity=IDENTITY, concern=concern, held=held)
        commands.finish_connect(session, task, opened)
    return seen(client, vehicle)


def create_connected(client: httpx2.Client, database: Database, name: str = "Drone", *, real: bool = False) -> Json:
    return connect(client, database, register(client, name, real=real))


def create_campaign_on(
    client: httpx2.Client, database: Database, vehicle: Json, *, rehearsed: bool = True, **fields: object
) -> Json:
    """One whose first gains are known, and which was rehearsed where that is needed."""
    answer = client.post(
        "/api/campaigns", json={"name": "Real", "vehicle": {"kind": vehicle["kind"], "id": vehicle["id"]}, **fields}
    )
    assert answer.status_code == 201, answer.text
    run_jobs(database)
    if rehearsed and vehicle["is_real"]:
        put_rehearsal(client, database, answer.json())
    campaign: Json = get(client, f"/api/campaigns/{answer.json()['id']}")
    assert campaign["state"] == "ready"
    return campaign


def put_rehearsal(client: httpx2.Client, database: Database, campaign: Json) -> None:
    """A rehearsal that passed, with made-up flights."""
    made = client.post(f"/api/campaigns/{campaign['id']}/rehearsal")
    assert made.status_code == 201, made.text
    run_jobs(database)
    with database.write() as session:
        for number in (1, 2, 3):
            session.add(
                TrialRow(
                    campaign_id=made.json()["id"],
                    number=number,
                    state=TrialState.VALID,
                    kind="step",
                    gains=DEFAULT_GAINS,
                    gate={"passed": True, "checks": []},
                    error=0.1,
                    seed=number,
                )
            )


def seen(client: httpx2.Client, vehicle: Json) -> Json:
    found: Json = get(client, f"/api/vehicles/{vehicle['id']}")
    return found


def put_into(state: VehicleState, database: Database, vehicle: Json) -> None:
    """Past the table, for tests of what is possible there."""
    with database.write() as session:
        row = session.get(VehicleRow, vehicle["id"])
        assert row is not None
        row.state = state
        row.concern = "its gains are not verified" if state == VehicleState.QUARANTINED else ""


def take_control(client: httpx2.Client, vehicle: Json, operator: str = "Ada", **fields: object) -> httpx2.Response:
    return client.put(f"/api/vehicles/{vehicle['id']}/control", json={"operator": operator, **fields})


def control_header(client: httpx2.Client, vehicle: Json, operator: str = "Ada") -> dict[str, str]:
    """Of a new lease, whoever had one."""
    answer = take_control(client, vehicle, operator, take_over=True)
    assert answer.status_code == 200, answer.text
    return {"X-Gainline-Control": answer.json()["token"]}


def finish_act(database: Database, *, problem: str = "", read_back: dict[str, float] | None = None) -> commands.ActTask:
    """Carry out the act that waits, as the worker does."""
    with database.write() as session:
        task = commands.claim_act(session, WORKER)
        assert task is not None
        commands.finish_act(session, task.act_id, problem=problem, read_back=read_back)
    return task
