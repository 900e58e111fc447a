"""One operator in control: a lease that runs out, is renewed by its token, and is taken over for everybody to see."""

from datetime import timedelta

from fastapi.testclient import TestClient

from app.db.base import utc_now
from app.db.models import VehicleRow
from app.db.outbox import latest_event_id
from app.db.session import Database
from app.fleet.control import LEASE
from tests.builders import Json, create_trial, get
from tests.fleet.vehicles import (
    control_header,
    create_campaign_on,
    create_connected,
    register,
    seen,
    take_control,
)


def let_lease_end(database: Database, vehicle: Json) -> None:
    with database.write() as session:
        row = session.get(VehicleRow, vehicle["id"])
        assert row is not None
        row.operator_until = utc_now() - timedelta(seconds=0.001)


def acts_of(client: TestClient, vehicle: Json) -> list[Json]:
    items: list[Json] = get(client, f"/api/vehicles/{vehicle['id']}/acts")["items"]
    return items


def test_control_lasts_as_long_as_it_is_renewed(client: TestClient, database: Database) -> None:
    vehicle = register(client)
    assert vehicle["control"] is None
    asked = utc_now()
    lease = take_control(client, vehicle).json()
    shown = seen(client, vehicle)["control"]
    assert shown == {"operator": "Ada", "until": lease["until"]}
    renewed = take_control(client, vehicle, token=lease["token"]).json()
    assert renewed["token"] == lease["token"]
    assert renewed["until"] > lease["until"]
    assert seen(client, vehicle)["control"]["until"] == renewed["until"]
    with database.read() as session:
        until = session.get_one(VehicleRow, vehicle["id"]).operator_until
        assert until is not None
        assert timedelta() <= until - asked - LEASE < timedelta(seconds=10)
    let_lease_end(database, vehicle)
    assert seen(client, vehicle)["control"] is None


def test_a_renewal_is_not_published(client: TestClient, database: Database) -> None:
    vehicle = register(client)
    lease = take_control(client, vehicle).json()
    with database.read() as session:
        before = latest_event_id(session)
    take_control(client, vehicle, token=lease["token"])
    with database.read() as session:
        assert latest_event_id(session) == before


def test_somebody_elses_control_is_refused_by_name_and_taken_over_visibly(client: TestClient) -> None:
    vehicle = register(client)
    ada = take_control(client, vehicle).json()
    refused = take_control(client, vehicle, "Grace")
    assert refused.status_code == 409
    assert refused.json()["detail"] == "Ada is in control of Drone."
    guessed = take_control(client, vehicle, "Grace", token="guessed")
    assert guessed.status_code == 409
    grace = take_control(client, vehicle, "Grace", take_over=True).json()
    assert grace["token"] != ada["token"]
    act = acts_of(client, vehicle)[0]
    assert (act["kind"], act["state"], act["by"], act["reason"]) == ("control", "done", "Grace", "took over from Ada")
    lost = take_control(client, vehicle, token=ada["token"])
    assert (lost.status_code, lost.json()["detail"]) == (409, "Grace is in control of Drone.")


def test_control_that_ran_out_is_free_for_others_and_comes_back_while_nobody_took_it(
    client: TestClient, database: Database
) -> None:
    vehicle = register(client)
    ada = take_control(client, vehicle).json()
    let_lease_end(database, vehicle)
    assert take_control(client, vehicle, token=ada["token"]).json()["token"] == ada["token"]
    let_lease_end(database, vehicle)
    assert take_control(client, vehicle, "Grace").status_code == 200
    let_lease_end(database, vehicle)
    late = take_control(client, vehicle, token=ada["token"])
    assert (late.status_code, late.json()["detail"]) == (409, "Your control of Drone has ended.")
    assert [act["kind"] for act in acts_of(client, vehicle)] == ["safe gains"]


def test_only_who_has_control_gives_it_up(client: TestClient) -> None:
    vehicle = register(client)
    path = f"/api/vehicles/{vehicle['id']}/control"
    assert client.delete(path).status_code == 204
    header = control_header(client, vehicle)
    for foreign in ({}, {"X-Gainline-Control": "guessed"}):
        assert client.delete(path, headers=foreign).status_code == 409
    assert client.delete(path, headers=header).status_code == 204
    assert seen(client, vehicle)["control"] is None


def test_the_token_is_never_stored(client: TestClient, database: Database) -> None:
    vehicle = register(client)
    token = take_control(client, vehicle).json()["token"]
    assert token.encode() not in database.file.read_bytes()
    wal = database.file.with_name(f"{database.file.name}-wal")
    assert not wal.exists() or token.encode() not in wal.read_bytes()


def test_what_changes_a_vehicle_is_refused_to_everybody_else_and_looking_is_not(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    campaign = create_campaign_on(client, database, vehicle)
    trial = create_trial(client, campaign["id"])
    header = control_header(client, vehicle)
    path = f"/api/vehicles/{vehicle['id']}"
    guarded = (
        f"{path}/restore",
        f"{path}/disconnect",
        f"/api/trials/{trial['id']}/stage",
        f"/api/trials/{trial['id']}/fly",
    )
    for act in guarded:
        refused = client.post(act)
        assert refused.status_code == 409
        assert refused.json()["detail"] == "Ada is in control of Drone."
    assert client.patch(path, json={"version": 1, "battery": "red"}).status_code == 409
    assert client.patch(path, json={"version": 1, "battery": "red"}, headers=header).status_code == 200
    looked = client.post(f"{path}/check")
    assert (looked.status_code, looked.json()["by"]) == (202, "")
    busy = client.post(f"{path}/restore", headers=header)
    assert (busy.status_code, busy.json()["title"]) == (409, "Vehicle busy")
