"""What a registered vehicle is asked beside its flights: when it may be, once at a time, and its outcome."""

import threading
from dataclasses import replace
from datetime import timedelta
from itertools import product

import pytest
from fastapi.testclient import TestClient

from app.common.settings import Settings
from app.common.states import ActKind, VehicleState
from app.db.base import utc_now
from app.db.models import TrialRow, VehicleActRow, VehicleRow
from app.db.session import Database
from app.fleet import commands
from app.flights import flight_rows
from app.flights.connection_manager import VehicleConnectionManager, VehicleSlot
from app.flights.flight_process import VehicleConnection
from app.flights.process_messages import status_time
from app.flights.worker_part import AbortRegistry, WorkerPart
from app.live.messages import VehicleStatus
from app.main import create_app
from app.vehicles.base import CheckItem, ConnectionOpened, Identity
from tests.builders import WORKER, Json, create_campaign, create_trial, get
from tests.fleet.vehicles import (
    DEFAULT_GAINS,
    IDENTITY,
    connect,
    control_header,
    create_campaign_on,
    create_connected,
    finish_act,
    put_into,
    register,
    seen,
)
from tests.unlocking import HERE, unlock

# What the domain allows, written apart from the program's table.
POSSIBLE = {
    "connect": {"disconnected"},
    "disconnect": {"ready", "quarantined"},
    "check": {"ready", "quarantined"},
    "restore": {"ready", "quarantined"},
    "parameters": {"ready"},
    "release": {"quarantined"},
    "stage": {"ready"},
    "fly": {"ready"},
    "edit": {"disconnected", "ready", "quarantined"},
    "configure": {"disconnected"},
    "delete": {"disconnected"},
    "land": {"staged", "flying", "quarantined"},
    "motors off": {"staged", "flying", "quarantined"},
}


def ask(client: TestClient, vehicle: Json, act: str) -> int:
    body = {"statement": "Ada looked at it"} if act == "release" else None
    return client.post(f"/api/vehicles/{vehicle['id']}/{act}", json=body).status_code


def lose_link(database: Database, vehicle: Json) -> None:
    with database.write() as session:
        commands.record_disconnected(session, vehicle["id"])


def newest(client: TestClient, vehicle: Json) -> Json:
    act: Json = get(client, f"/api/vehicles/{vehicle['id']}/acts")["items"][0]
    return act


def request(client: TestClient, vehicle: Json, trial: Json | None, act: str) -> int:
    """The answer to a request for an act; of a flight, for the trial."""
    match act:
        case "stage" | "fly":
            assert trial is not None
            return client.post(f"/api/trials/{trial['id']}/{act}").status_code
        case "edit":
            return client.patch(f"/api/vehicles/{vehicle['id']}", json={"version": 1, "battery": "4"}).status_code
        case "configure":
            asked = {"version": 1, "options": {"system_id": 5}}
            return client.patch(f"/api/vehicles/{vehicle['id']}", json=asked).status_code
        case _:
            return ask(client, vehicle, act)


ASKED = ("connect", "disconnect", "check", "restore", "parameters", "release", "stage", "fly", "edit", "configure")


def test_a_vehicle_is_asked_nothing_that_its_state_does_not_allow(client: TestClient, database: Database) -> None:
    vehicle = register(client)
    trial = create_trial(client, create_campaign_on(client, database, vehicle)["id"])
    for act, state in product(ASKED, VehicleState):
        if state not in POSSIBLE[act]:
            put_into(state, database, vehicle)
            assert request(client, vehicle, trial, act) == 409, (act, state)
            assert seen(client, vehicle)["state"] == state


@pytest.mark.complete
def test_a_vehicle_is_asked_what_its_state_allows(client: TestClient, database: Database) -> None:
    """Each of a vehicle of its own; flights are staged and flown by the tests of flights."""
    for act, state in product(ASKED, VehicleState):
        if state in POSSIBLE[act] and act not in {"stage", "fly"}:
            vehicle = register(client, f"To {act}, {state}")
            put_into(state, database, vehicle)
            assert request(client, vehicle, None, act) in {200, 202}, (act, state)
            assert seen(client, vehicle)["state"] == state


@pytest.mark.parametrize("real", [False, True])
@pytest.mark.parametrize("state", VehicleState)
def test_the_offered_actions_are_the_possible_ones(
    client: TestClient, database: Database, state: VehicleState, real: bool
) -> None:
    vehicle = register(client, real=real)
    put_into(state, database, vehicle)
    possible = {act for act, states in POSSIBLE.items() if state in states}
    assert set(seen(client, vehicle)["actions"]) == possible - ({"fly"} if real else set())


def test_a_connection_pins_the_identity_and_reports_the_gains(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    assert (vehicle["state"], vehicle["held"], vehicle["concern"]) == ("ready", DEFAULT_GAINS, "")
    act = newest(client, vehicle)
    assert (act["kind"], act["state"], act["asked"], act["read_back"]) == (
        "connect",
        "done",
        None,
        DEFAULT_GAINS,
    )
    with database.write() as session:
        commands.record_connected(
            session, vehicle["id"], ConnectionOpened(identity=Identity(system_id=9, autopilot="px4", version=""))
        )
    assert seen(client, vehicle)["identity"]["system_id"] == 1


def test_a_second_request_is_refused_and_the_same_one_sent_again_is_harmless(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    path = f"/api/vehicles/{vehicle['id']}/check"
    first = client.post(path, headers={"Idempotency-Key": "once"})
    again = client.post(path, headers={"Idempotency-Key": "once"})
    assert (again.status_code, again.json()) == (202, first.json())
    other = client.post(f"/api/vehicles/{vehicle['id']}/restore")
    assert other.status_code == 409
    assert other.json()["detail"] == "Drone is busy: its gains are being checked."
    finish_act(database)
    assert client.post(f"/api/vehicles/{vehicle['id']}/restore").status_code == 202


def test_nothing_is_asked_beside_a_flight_and_no_flight_beside_an_act(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    campaign = create_campaign_on(client, database, vehicle)
    trial = create_trial(client, campaign["id"])
    client.post(f"/api/vehicles/{vehicle['id']}/check")
    refused = client.post(f"/api/trials/{trial['id']}/stage")
    assert (refused.status_code, refused.json()["detail"]) == (409, "Drone is busy: its gains are being checked.")
    finish_act(database)
    assert client.post(f"/api/trials/{trial['id']}/stage").status_code == 202
    beside = client.post(f"/api/vehicles/{vehicle['id']}/check")
    assert (beside.status_code, beside.json()["title"]) == (409, "Vehicle busy")
    assert "already has a flight" in beside.json()["detail"]


def test_what_nobody_begins_in_time_is_given_up(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    ask(client, vehicle, "restore")
    with database.write() as session:
        row = session.get_one(VehicleActRow, newest(client, vehicle)["id"])
        row.requested_at = utc_now() - timedelta(seconds=11)
    with database.write() as session:
        assert commands.claim_act(session, WORKER) is None
    act = newest(client, vehicle)
    assert (act["state"], act["problem"]) == ("failed", "It could not be started within 10 s. Request it again.")


def test_a_check_keeps_every_item_it_found(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    ask(client, vehicle, "check")
    item = CheckItem(name="rate", title="Positions a second", passed=False, found="12 Hz", needed="40 Hz", hint="Look")
    with database.write() as session:
        task = commands.claim_act(session, WORKER)
        assert task is not None
        commands.record_checks(session, vehicle["id"], [item])
        commands.finish_act(session, task.act_id, result={"passed": False})
        commands.finish_act(session, task.act_id, problem="twice is harmless")
    (check,) = seen(client, vehicle)["checks"]
    assert check == {
        "name": "rate",
        "title": "Positions a second",
        "passed": False,
        "found": "12 Hz",
        "needed": "40 Hz",
        "hint": "Look",
    }
    assert newest(client, vehicle)["result"] == {"passed": False}


def manager_of(database: Database, settings: Settings, *, links: bool = True) -> VehicleConnectionManager:
    part = WorkerPart(
        database=database,
        data_dir=settings.data_dir,
        abort_registry=AbortRegistry(),
        publish=lambda _shown: None,
        worker=WORKER,
        closing=threading.Event(),
    )
    return VehicleConnectionManager(part, links=links)


FAILED = CheckItem(name="failsafe", title="FS_GCS_ENABLE", passed=False, found="off", needed="on")


def test_a_check_says_nothing_of_a_vehicle_that_was_connected_since(client: TestClient, database: Database) -> None:
    """Observed defect: a failed check from before a restart kept the vehicle from being staged."""
    vehicle = create_connected(client, database)
    with database.write() as session:
        commands.record_checks(session, vehicle["id"], [FAILED])
        commands.record_disconnected(session, vehicle["id"])
    assert seen(client, vehicle)["checks"] is not None
    connected = connect(client, database, vehicle)
    assert (connected["checks"], connected["checked_at"]) == (None, None)


def test_a_check_says_nothing_of_a_vehicle_that_has_restarted_since(
    settings: Settings, client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    manager = manager_of(database, settings)

    def checks_after(restarts: list[int]) -> object:
        slot = VehicleSlot()
        with database.write() as session:
            commands.record_checks(session, vehicle["id"], [FAILED])
        for count in restarts:
            manager._on_message(
                slot,
                vehicle["id"],
                VehicleStatus(vehicle_id=vehicle["id"], state="connected", at=status_time(), step="", restarts=count),
            )
        manager._record_executor.submit(lambda: None).result()
        return seen(client, vehicle)["checks"]

    assert checks_after([1, 1]) is not None, "it restarted before its connection was open"
    assert checks_after([0, 0, 1]) is None


def test_the_newest_concern_of_a_vehicle_is_the_one_that_is_kept(
    settings: Settings, client: TestClient, database: Database
) -> None:
    vehicle = connect(client, database, register(client), concern="it was met armed")
    manager = manager_of(database, settings)
    status = VehicleStatus(vehicle_id=vehicle["id"], state="connected", at=status_time(), step="")
    slot = VehicleSlot(concern="it was met armed")
    for concern in ("it was met armed", "its motors did not stop"):
        manager._on_message(slot, vehicle["id"], replace(status, concern=concern))
    manager._record_executor.submit(lambda: None).result()
    assert seen(client, vehicle)["concern"] == "its motors did not stop"


def test_a_vehicle_met_armed_is_quarantined_until_a_person_releases_it(client: TestClient, database: Database) -> None:
    vehicle = connect(client, database, register(client), concern="it was met armed")
    assert (vehicle["state"], vehicle["concern"]) == ("quarantined", "it was met armed")
    campaign = create_campaign_on(client, database, vehicle)
    refused = client.post(f"/api/trials/{create_trial(client, campaign['id'])['id']}/stage")
    assert refused.json()["detail"] == "Drone is quarantined: it was met armed"
    header = control_header(client, vehicle)
    statement = {"statement": "disarmed, on the ground"}
    path = f"/api/vehicles/{vehicle['id']}/release"
    assert client.post(path, json=statement, headers=header).json()["state"] == "quarantined"
    accepted = Identity(system_id=1, autopilot="paparazzi", version="6.0")
    with database.write() as session:
        task = commands.claim_act(session, WORKER)
        assert task is not None
        assert (task.kind, task.vehicle.identity) == (ActKind.RELEASE, None), "nobody has decided about it yet"
        commands.finish_act(session, task.act_id, read_back=DEFAULT_GAINS)
        commands.record_released(session, vehicle["id"], identity=accepted)
    free = seen(client, vehicle)
    assert (free["state"], free["concern"], free["identity"]["version"]) == ("ready", "", "6.0")
    act = newest(client, vehicle)
    assert (act["by"], act["reason"]) == ("Ada", "disarmed, on the ground")


def test_a_quarantine_outlives_the_link(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    with database.write() as session:
        commands.quarantine_vehicle(session, vehicle["id"], "its gains are not verified")
    ask(client, vehicle, "disconnect")
    finish_act(database)
    lose_link(database, vehicle)
    assert seen(client, vehicle)["state"] == "disconnected"
    again = connect(client, database, vehicle)
    assert (again["state"], again["concern"]) == ("quarantined", "its gains are not verified")


def test_a_released_simulation_is_ready_at_once_and_its_acts_say_who_looked(
    client: TestClient, database: Database
) -> None:
    vehicle = create_campaign(client)["vehicle"]
    path, said = f"/api/vehicles/{vehicle['id']}/release", {"statement": "Ada: it is fine"}
    assert "only while it is quarantined" in client.post(path, json=said).json()["hint"]
    put_into(VehicleState.QUARANTINED, database, vehicle)
    released = client.post(path, json=said).json()
    assert (released["state"], released["concern"]) == ("ready", "")
    assert newest(client, vehicle)["reason"] == "Ada: it is fine"


def test_a_restarted_worker_connects_again_what_was_wanted_and_does_nothing_else(
    client: TestClient, database: Database
) -> None:
    wanted, closed, doubted = (create_connected(client, database, name) for name in ("A", "B", "C"))
    ask(client, closed, "disconnect")
    finish_act(database)
    with database.write() as session:
        commands.quarantine_vehicle(session, doubted["id"], "not verified")
    ask(client, wanted, "restore")
    with database.write() as session:
        commands.recover(session)
        commands.request_reconnections(session)
    states = [seen(client, vehicle)["state"] for vehicle in (wanted, closed, doubted)]
    assert states == ["disconnected", "disconnected", "quarantined"]
    tasks = [finish_act(database, problem="nobody answers") for _ in range(2)]
    assert [(task.kind, task.vehicle.name) for task in tasks] == [("connect", "A"), ("connect", "C")]
    assert newest(client, wanted)["by"] == "the worker"
    with database.write() as session:
        assert commands.claim_act(session, WORKER) is None
        assert len(commands.request_reconnections(session)) == 2  # wanted still: a person asked for it


def test_a_vehicle_found_with_gains_of_its_own_is_met_for_the_first_time_until_a_person_has_decided(
    client: TestClient, database: Database
) -> None:
    vehicle = register(client)
    for _ in range(2):
        connect(client, database, vehicle, concern="It holds others; nothing was written.")
        assert client.get(f"/api/vehicles/{vehicle['id']}/ledger").json()["items"] == []
        assert ask(client, vehicle, "check") == 202
        assert finish_act(database).vehicle.identity is None, "whoever connects it compares, and writes nothing"
        lose_link(database, vehicle)
    connect(client, database, vehicle)
    assert ask(client, vehicle, "check") == 202
    assert finish_act(database).vehicle.identity is not None


def test_a_pinned_vehicle_is_looked_for_after_a_connect_that_failed_until_somebody_stops_it(
    client: TestClient, database: Database
) -> None:
    known, new = create_connected(client, database, "A"), register(client, "B")
    ask(client, known, "disconnect")
    finish_act(database)
    lose_link(database, known)
    assert "disconnect" not in seen(client, known)["actions"]
    for vehicle in (known, new):
        ask(client, vehicle, "connect")
        finish_act(database, problem="the port is in use by another vehicle")
    with database.read() as session:
        assert [each.name for each in commands.list_vehicles_to_reconnect(session)] == ["A"]
    assert "disconnect" in seen(client, known)["actions"]
    assert "disconnect" not in seen(client, new)["actions"]
    ask(client, known, "disconnect")
    finish_act(database)
    with database.write() as session:  # found in the very moment in which it was not wanted any more
        identity = Identity(system_id=9, autopilot="paparazzi", version="")
        assert not commands.record_reconnected(
            session, known["id"], ConnectionOpened(identity=identity, concern="", held=known["safe_gains"])
        )
    with database.read() as session:
        assert commands.list_vehicles_to_reconnect(session) == []
    assert seen(client, known)["state"] == "disconnected"


def test_a_vehicle_may_be_in_the_air_after_a_flight_until_its_gains_are_read_or_no_battery_lasts_any_longer(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    trial = create_trial(client, create_campaign_on(client, database, vehicle)["id"])
    assert client.post(f"/api/trials/{trial['id']}/fly").status_code == 202

    def may_fly() -> bool:
        with database.write() as session:
            commands.recover(session)
            (found,) = commands.list_vehicles_to_reconnect(session)
        return found.was_flying

    with database.write() as session:
        request = flight_rows.claim_flight(session, WORKER)
        assert request is not None
        flight_rows.record_staged(session, request.flight_id, dict(request.gains))
    with database.write() as session:
        flight_rows.record_lift_off(session, request.flight_id)
    with database.write() as session:
        flight_rows.lose_running_flights(session)
    assert may_fly()
    with database.write() as session:
        assert commands.record_reconnected(
            session, vehicle["id"], ConnectionOpened(identity=IDENTITY, concern="It is armed.")
        )
        commands.record_disconnected(session, vehicle["id"])
    assert newest(client, vehicle)["reason"] == "It is armed."
    assert may_fly(), "no gains were read of an armed vehicle"
    with database.write() as session:
        flown = session.get_one(TrialRow, trial["id"])
        flown.flown_at = utc_now() - timedelta(hours=1)
    assert not may_fly()
    with database.write() as session:
        session.get_one(TrialRow, trial["id"]).flown_at = utc_now()
    assert may_fly()
    connect(client, database, vehicle)
    lose_link(database, vehicle)
    assert not may_fly(), "it was on the ground, with its safe gains"


def test_the_ledger_names_no_gains_for_a_pinned_vehicle_that_was_armed_or_absent_when_it_was_connected(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    lose_link(database, vehicle)
    ask(client, vehicle, "connect")
    finish_act(database, problem="nobody answers")
    with database.write() as session:
        identity = Identity(system_id=1, autopilot="paparazzi", version="")
        assert commands.record_reconnected(
            session, vehicle["id"], ConnectionOpened(identity=identity, concern="It is armed.")
        )
    given = client.get(f"/api/vehicles/{vehicle['id']}/ledger").json()["items"]
    assert [(line["purpose"], line["asked"], line["read_back"]) for line in given] == [("connect", {}, DEFAULT_GAINS)]


def test_the_link_to_a_vehicle_that_is_found_when_nobody_wants_it_any_more_is_closed(
    settings: Settings, client: TestClient, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disconnect that the worker took too late to begin it."""
    vehicle = create_connected(client, database)
    events: list[str] = []

    class Found(VehicleConnection):
        def __init__(self, *_: object, **__: object) -> None:
            pass

        def wait_until_open(self) -> ConnectionOpened:
            ask(client, vehicle, "disconnect")
            with database.write() as session:
                commands.recover(session)
            events.append("found")
            return ConnectionOpened(identity=IDENTITY, concern="", held=dict(DEFAULT_GAINS))

        def request_close(self) -> None:
            pass

        def close(self) -> None:
            events.append("closed")

    monkeypatch.setattr("app.flights.connection_manager.VehicleConnection", Found)
    lose_link(database, vehicle)
    manager = manager_of(database, settings)
    manager.maintain()
    manager._reconnect_executor.shutdown()
    assert events == ["found", "closed"]
    assert "No worker has a link" in manager.order(vehicle["id"], "land", "a person asks", by_s=0.0).result(0)
    assert seen(client, vehicle)["state"] == "disconnected"


def test_what_a_restarted_worker_does_not_do_tells_whether_it_was_begun(client: TestClient, database: Database) -> None:
    begun, waiting = (create_connected(client, database, name) for name in ("A", "B"))
    ask(client, begun, "restore")
    with database.write() as session:
        commands.claim_act(session, WORKER)
    ask(client, waiting, "restore")
    with database.write() as session:
        commands.recover(session)
    assert [(newest(client, vehicle)["state"], newest(client, vehicle)["problem"]) for vehicle in (begun, waiting)] == [
        ("failed", "It was not finished: the worker stopped. Request it again if it is still needed."),
        (
            "failed",
            "It was not started: no worker was running when it was requested. Request it again if it is still needed.",
        ),
    ]


@pytest.mark.complete
def test_a_vehicle_with_a_link_is_asked_nothing_but_to_be_let_go_over_a_server_that_others_reach(
    settings: Settings, client: TestClient, database: Database
) -> None:
    met, doubted = create_connected(client, database, "Real", real=True), register(client, "Doubted", real=True)
    connect(client, database, doubted, concern="its motors run")
    simulated = register(client, "Simulated")
    asked = [(register(client, "Away", real=True), "connect", {}), (doubted, "release", {"statement": "seen by Ada"})]
    asked += [(met, kind, {}) for kind in ("check", "restore", "parameters")]
    exposed = settings.model_copy(update={"host": "0.0.0.0"})
    with TestClient(create_app(exposed), base_url="http://127.0.0.1:8000", client=HERE) as network:
        for vehicle, kind, body in asked:
            refused = network.post(f"/api/vehicles/{vehicle['id']}/{kind}", json=body)
            assert refused.status_code == 403, kind
            assert "it is a real vehicle, and other devices can reach the server" in refused.json()["detail"]
        edit = {"version": met["version"], "safe_gains": {"kp": 300, "ki": 13, "kd": 82}, "statement": "Ada says so"}
        assert network.patch(f"/api/vehicles/{met['id']}", json=edit).status_code == 403
        assert network.post(f"/api/vehicles/{met['id']}/disconnect").status_code == 403
        unlock(network)
        assert network.post(f"/api/vehicles/{met['id']}/disconnect").status_code == 202
        refused = network.post(f"/api/vehicles/{simulated['id']}/connect")
        assert (refused.status_code, "is connected over a link" in refused.json()["detail"]) == (403, True)


@pytest.mark.parametrize("links", [False, True])
def test_a_worker_beside_a_server_that_others_reach_connects_no_vehicle_again(
    client: TestClient, database: Database, settings: Settings, links: bool
) -> None:
    vehicles = [create_connected(client, database, name, real=name == "Real") for name in ("Simulated", "Real")]
    before = [newest(client, vehicle)["id"] for vehicle in vehicles]
    manager = manager_of(database, settings, links=links)
    manager.recover()
    manager.maintain()
    manager.close()
    after = [newest(client, vehicle)["id"] for vehicle in vehicles]
    assert [now != known for now, known in zip(after, before, strict=True)] == [links, links]


@pytest.mark.parametrize(("field", "told"), [("version", ("", "5.18", "", "5.20")), ("uid", ("", "0a", "", "0b"))])
def test_version_and_hardware_id_are_pinned_when_they_are_told_and_changed_by_a_release_alone(
    client: TestClient, database: Database, field: str, told: tuple[str, ...]
) -> None:
    """Paparazzi sends its version every few seconds, often only after the connection."""
    vehicle = register(client)
    known = {"version": "1.16.0"}

    def identity(value: str) -> Identity:
        return Identity(system_id=1, autopilot="px4", **{**known, field: value})

    def pinned() -> str:
        return str(seen(client, vehicle)["identity"][field])

    def connected_as(value: str) -> str:
        with database.write() as session:
            commands.record_connected(session, vehicle["id"], ConnectionOpened(identity=identity(value)))
        lose_link(database, vehicle)
        return pinned()

    assert [connected_as(value) for value in told] == ["", told[1], told[1], told[1]]
    for value in (told[3], ""):  # it tells none any more, and is accepted as it is
        put_into(VehicleState.QUARANTINED, database, vehicle)
        with database.write() as session:
            commands.record_released(session, vehicle["id"], identity=identity(value))
        assert pinned() == value


def test_an_identity_that_was_pinned_before_hardware_ids_were_looked_at_is_read(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    with database.write() as session:
        row = session.get(VehicleRow, vehicle["id"])
        assert row is not None
        row.identity = {"system_id": 1, "autopilot": "paparazzi", "version": "5.18"}
    assert seen(client, vehicle)["identity"]["uid"] == ""
    with database.write() as session:
        assert commands._linked(session, session.get_one(VehicleRow, vehicle["id"])).identity == IDENTITY
        commands.pin_identity(
            session, vehicle["id"], Identity(system_id=1, autopilot="paparazzi", version="", uid="0a")
        )
    pinned = {"system_id": 1, "autopilot": "paparazzi", "version": "5.18", "uid": "0a"}
    assert seen(client, vehicle)["identity"] == pinned


def test_an_order_past_the_database_is_written_down_afterwards(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    with database.write() as session:
        commands.record_command(session, vehicle["id"], ActKind.LAND, "it drifts")
        commands.record_command(session, vehicle["id"], ActKind.MOTORS_OFF, "fire", problem="the link was closed")
    stopped, landed = get(client, f"/api/vehicles/{vehicle['id']}/acts?limit=2")["items"]
    assert (landed["kind"], landed["state"], landed["reason"]) == ("land", "done", "it drifts")
    assert (stopped["kind"], stopped["state"], stopped["problem"]) == ("motors off", "failed", "the link was closed")


def test_acts_come_in_pages_the_newest_first(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    for _ in range(3):
        ask(client, vehicle, "restore")
        finish_act(database)
    path = f"/api/vehicles/{vehicle['id']}/acts"
    first = get(client, f"{path}?limit=3")
    rest = get(client, f"{path}?limit=3&cursor={first['next_cursor']}")
    ids = [act["id"] for act in (*first["items"], *rest["items"])]
    assert ids == sorted(ids, reverse=True)
    assert (len(ids), first["total"], rest["next_cursor"]) == (5, 5, None)
