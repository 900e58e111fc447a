"""Vehicles registered one by one: their settings, their safe gains, and what of them may change when."""

from fastapi.testclient import TestClient

from app.common.settings import Settings
from app.common.states import VehicleState
from app.db.models import VehicleRow
from app.db.session import Database
from app.fleet import commands
from app.main import create_app
from app.vehicles.base import ConnectionOpened
from tests.builders import create_campaign, get, problems_of
from tests.fleet.vehicles import (
    DEFAULT_GAINS,
    IDENTITY,
    SEEN,
    create_campaign_on,
    create_connected,
    finish_act,
    put_into,
    register,
    seen,
)
from tests.unlocking import HERE, unlock


def test_a_registered_vehicle_has_settings_of_its_own_and_is_not_connected(client: TestClient) -> None:
    vehicle = register(client, options={"simulated": True, "system_id": 7})
    assert (vehicle["registered"], vehicle["is_real"], vehicle["state"]) == (True, False, "disconnected")
    assert (vehicle["name"], vehicle["title"], vehicle["version"]) == ("Drone", "Vehicle over MAVLink", 1)
    assert vehicle["options"]["system_id"] == 7
    assert vehicle["options"]["telemetry_hz"] == 50
    assert (vehicle["safe_gains"], vehicle["held"], vehicle["identity"]) == (DEFAULT_GAINS, None, None)
    assert vehicle["actions"] == ["connect", "edit", "configure", "delete"]
    assert seen(client, vehicle) == vehicle


def test_a_vehicle_that_an_earlier_version_stored_has_the_later_settings_at_their_defaults(
    client: TestClient, database: Database
) -> None:
    vehicle = register(client, options={"simulated": True, "system_id": 7})
    with database.write() as session:
        row = session.get_one(VehicleRow, vehicle["id"])
        kept = {name: value for name, value in row.options.items() if name != "telemetry_hz"}
        row.options = {**kept, "given_up": 3.0}
    assert seen(client, vehicle)["options"] == vehicle["options"]
    with database.read() as session:
        assert commands._linked(session, session.get_one(VehicleRow, vehicle["id"])).options == vehicle["options"]


def test_a_vehicle_is_real_unless_it_is_registered_as_simulated_on_this_computer_or_a_named_host(
    settings: Settings, client: TestClient
) -> None:
    assert register(client, "A", real=True)["is_real"]
    far = {"simulated": True, "address": "udp:10.1.2.3:4245@4244"}
    refused = client.post("/api/vehicles", json={"name": "B", "kind": "mavlink", "options": far})
    assert refused.status_code == 422
    assert problems_of(refused)["options.simulated"].startswith("must be off for udp:10.1.2.3:4245@4244")
    named = settings.model_copy(update={"simulation_hosts": frozenset({"10.1.2.3"})})
    with TestClient(create_app(named), base_url="http://127.0.0.1:8000", client=HERE) as informed:
        assert not register(informed, "B", options=far)["is_real"]
        assert register(informed, "C", real=True, options={**far, "simulated": False})["is_real"]


def test_a_person_has_looked_at_a_real_vehicles_safe_gains(client: TestClient) -> None:
    unlock(client)
    asked = {"name": "Drone", "kind": "mavlink", "options": {}}
    refused = client.post("/api/vehicles", json=asked)
    assert refused.status_code == 409
    assert refused.json()["title"] == "Confirmation needed"
    assert "kp 283, ki 13, kd 82" in refused.json()["detail"]
    assert set(problems_of(refused)) == {"safe_gains_confirmed", "statement"}
    vehicle = client.post("/api/vehicles", json={**asked, **SEEN}).json()
    (act,) = get(client, f"/api/vehicles/{vehicle['id']}/acts")["items"]
    assert (act["kind"], act["state"], act["reason"]) == ("safe gains", "done", SEEN["statement"])
    assert act["asked"] == DEFAULT_GAINS


def test_the_autopilot_decides_which_gains_a_vehicle_has(client: TestClient) -> None:
    vehicle = register(client, options={"simulated": True, "autopilot": "px4"})
    assert "MPC_Z_P" in vehicle["safe_gains"]
    refused = client.post("/api/campaigns", json={"name": "A", "vehicle": {"kind": "mavlink", "id": vehicle["id"]}})
    assert "MPC_Z_P" in problems_of(refused)["vehicle.id"]
    other = client.patch(f"/api/vehicles/{vehicle['id']}", json={"version": 1, "options": {"autopilot": "paparazzi"}})
    assert other.status_code == 422


def test_unusable_fields_are_named(client: TestClient) -> None:
    def refusal(**fields: object) -> set[str]:
        asked = {"name": "Drone", "kind": "mavlink", "options": {"simulated": True}, **fields}
        answer = client.post("/api/vehicles", json=asked)
        assert answer.status_code == 422
        return set(problems_of(answer))

    assert refusal(kind="balloon") == {"kind"}
    assert refusal(kind="twin") == {"kind"}
    assert refusal(options={"system_id": 999, "wings": 2}) == {"options.system_id", "options.wings"}
    assert refusal(safe_gains={"kp": 283, "ki": 13}) == {"safe_gains.kd"}
    assert refusal(safe_gains={"kp": 1e9, "ki": 13, "kd": 82}) == {"safe_gains.kp"}


def test_everything_that_is_wrong_with_a_registration_is_named_at_once(client: TestClient) -> None:
    """Observed defect: options, gains, name and confirmation were refused one after another."""
    unlock(client)
    register(client, "Drone")
    asked = {
        "name": "Drone",
        "kind": "mavlink",
        "options": {"address": "somewhere", "radius_m": 1e6, "system_id": 3},
        "safe_gains": {"kp": -1, "kd": 100, "ki": 50},
    }
    answer = client.post("/api/vehicles", json=asked)
    assert answer.status_code == 422
    assert [problem["field"] for problem in answer.json()["problems"]] == [
        "options.radius_m",
        "options.address",
        "safe_gains.kp",
        "name",
    ]
    asked["options"] = {}
    fields = [problem["field"] for problem in client.post("/api/vehicles", json=asked).json()["problems"]]
    assert fields == ["safe_gains.kp", "name", "safe_gains_confirmed", "statement"]
    asked |= {"options": {"autopilot": "px5"}, "safe_gains": {"PSC_POSZ_P": 1.0}}
    fields = [problem["field"] for problem in client.post("/api/vehicles", json=asked).json()["problems"]]
    assert fields == ["options.autopilot", "name"], "whose gains they are, nobody knows"


def test_a_name_belongs_to_one_vehicle(client: TestClient) -> None:
    register(client)
    other = register(client, "Other")
    twice = client.post("/api/vehicles", json={"name": " drone ", "kind": "mavlink", "options": {"simulated": True}})
    assert (twice.status_code, set(problems_of(twice))) == (409, {"name"})
    renamed = client.patch(f"/api/vehicles/{other['id']}", json={"version": 1, "name": "DRONE"})
    assert (renamed.status_code, set(problems_of(renamed))) == (409, {"name"})
    assert client.patch(f"/api/vehicles/{other['id']}", json={"version": 1, "name": "other"}).status_code == 200


def test_a_campaign_names_the_registered_vehicle_that_flies_it(client: TestClient, database: Database) -> None:
    missing = client.post("/api/campaigns", json={"name": "A", "vehicle": {"kind": "mavlink"}})
    assert missing.status_code == 422
    assert "a vehicle of this kind must be registered first" in problems_of(missing)["vehicle.id"]
    assert "POST /api/vehicles" in missing.json()["script_hint"]
    one, two = register(client, "One"), register(client, "Two", real=True)
    campaign = create_campaign_on(client, database, two)
    shown = campaign["vehicle"]
    assert (shown["id"], shown["name"], shown["registered"], shown["needs_staging"]) == (two["id"], "Two", True, True)
    assert shown["options"] == two["options"]
    assert campaign["next_action"] == "Fly the first flight"
    put_into(VehicleState.QUARANTINED, database, two)
    assert get(client, f"/api/campaigns/{campaign['id']}")["next_action"] == "Inspect and release the vehicle"
    put_into(VehicleState.DISCONNECTED, database, two)
    clone = client.post(f"/api/campaigns/{campaign['id']}/clone").json()
    assert clone["vehicle"]["id"] == two["id"]
    moved = client.patch(
        f"/api/campaigns/{clone['id']}",
        json={"version": 1, "vehicle": {"kind": "mavlink", "id": one["id"]}},
    )
    assert moved.json()["vehicle"]["name"] == "One"
    for choice, field in (
        ({"kind": "mavlink", "id": 99}, "vehicle.id"),
        ({"kind": "twin", "id": one["id"]}, "vehicle.kind"),
        ({"kind": "mavlink", "id": one["id"], "options": {"system_id": 3}}, "vehicle.options"),
    ):
        refused = client.post("/api/campaigns", json={"name": "A", "vehicle": choice})
        assert (refused.status_code, set(problems_of(refused))) == (422, {field})


def test_a_shared_simulation_cannot_be_chosen_by_id_or_edited_and_takes_no_acts(client: TestClient) -> None:
    shared = create_campaign(client)["vehicle"]
    assert (shared["registered"], shared["needs_staging"]) == (False, False)
    refused = client.post("/api/campaigns", json={"name": "A", "vehicle": {"kind": "twin", "id": shared["id"]}})
    assert set(problems_of(refused)) == {"vehicle.id"}
    path = f"/api/vehicles/{shared['id']}"
    for act in (client.patch(path, json={"version": 1, "battery": "3"}), client.post(f"{path}/connect")):
        assert (act.status_code, "shared by all campaigns" in act.json()["detail"]) == (409, True)


def test_the_link_changes_only_while_it_is_closed_and_pins_the_identity_anew(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    assert vehicle["identity"] == {"system_id": 1, "autopilot": "paparazzi", "version": "5.18", "uid": ""}
    path = f"/api/vehicles/{vehicle['id']}"
    change = {"version": 1, "options": {"system_id": 5}}
    assert "connected" in client.patch(path, json=change).json()["detail"]
    same = client.patch(path, json={"version": 1, "options": vehicle["options"]})
    assert (same.status_code, same.json()["identity"]["system_id"]) == (200, 1)
    assert client.post(f"{path}/disconnect").status_code == 202
    finish_act(database)
    put_into(VehicleState.DISCONNECTED, database, vehicle)
    edited = client.patch(path, json={**change, "version": 2}).json()
    assert (edited["options"]["system_id"], edited["identity"], edited["version"]) == (5, None, 3)
    assert edited["options"]["simulated"] is True
    with database.write() as session:
        commands.record_connected(session, vehicle["id"], ConnectionOpened(identity=IDENTITY))
    assert seen(client, vehicle)["identity"]["system_id"] == 1


def test_changed_settings_are_in_the_command_log(client: TestClient) -> None:
    vehicle = register(client)
    edit = {"version": vehicle["version"], "options": {"radius_m": 7.0}}
    assert client.patch(f"/api/vehicles/{vehicle['id']}", json=edit).status_code == 200
    newest = get(client, f"/api/vehicles/{vehicle['id']}/acts")["items"][0]
    assert (newest["kind"], newest["reason"], newest["state"]) == (
        "settings",
        "Maximum distance from the start: 7 m",
        "done",
    )


def test_a_simulated_vehicle_never_becomes_a_real_one(client: TestClient) -> None:
    vehicle = register(client)
    path = f"/api/vehicles/{vehicle['id']}"
    refused = client.patch(path, json={"version": 1, "options": {"simulated": False}})
    assert (refused.status_code, set(problems_of(refused))) == (422, {"options"})
    assert "Register the other vehicle separately" in refused.json()["hint"]


def test_an_edit_of_an_outdated_version_is_a_conflict(client: TestClient) -> None:
    vehicle = register(client)
    path = f"/api/vehicles/{vehicle['id']}"
    assert client.patch(path, json={"version": 1, "battery": "blue 2"}).json()["version"] == 2
    late = client.patch(path, json={"version": 1, "battery": "red 1", "name": "Drone"})
    assert late.status_code == 409
    assert problems_of(late) == {"version": "is 2, got 1", "battery": "is now “blue 2”; you entered “red 1”"}
    assert seen(client, vehicle)["battery"] == "blue 2"


def test_safe_gains_change_with_a_statement_and_only_while_the_vehicle_is_at_rest(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    path = f"/api/vehicles/{vehicle['id']}"
    better = {"kp": 250, "ki": 10, "kd": 100}
    unsaid = client.patch(path, json={"version": 1, "safe_gains": better})
    assert (unsaid.status_code, set(problems_of(unsaid))) == (422, {"statement"})
    asked = {"version": 1, "safe_gains": better, "statement": "Ada: best of 12 flights"}
    for state in (VehicleState.STAGED, VehicleState.FLYING):
        put_into(state, database, vehicle)
        refused = client.patch(path, json=asked)
        assert refused.status_code == 409
        assert "cannot be edited: it is" in refused.json()["detail"]
    put_into(VehicleState.QUARANTINED, database, vehicle)
    assert client.patch(path, json=asked).json()["safe_gains"] == better
    act = get(client, f"{path}/acts")["items"][0]
    assert (act["kind"], act["reason"], act["asked"]) == ("safe gains", "Ada: best of 12 flights", better)


def test_new_safe_gains_have_the_first_proposal_of_what_has_not_flown_computed_again(
    client: TestClient, database: Database
) -> None:
    vehicle = register(client)
    campaign = create_campaign_on(client, database, vehicle)
    path = f"/api/campaigns/{campaign['id']}/proposal"
    assert get(client, path)["state"] == "ready"
    asked = {"version": 1, "safe_gains": {"kp": 250, "ki": 10, "kd": 100}, "statement": "Ada"}
    assert client.patch(f"/api/vehicles/{vehicle['id']}", json=asked).status_code == 200
    assert get(client, path)["state"] == "computing"


def test_a_vehicle_that_no_campaign_uses_is_deleted_with_its_acts(client: TestClient, database: Database) -> None:
    vehicle = register(client)
    path = f"/api/vehicles/{vehicle['id']}"
    assert client.delete(path).status_code == 422
    assert client.delete(path, params={"version": 2}).status_code == 409
    assert client.delete(path, params={"version": 1}).status_code == 204
    assert client.get(path).status_code == 404
    assert client.get(f"{path}/acts").status_code == 404
    assert register(client)["id"] > vehicle["id"]


def test_a_vehicle_that_campaigns_use_is_kept_and_they_are_named(client: TestClient, database: Database) -> None:
    vehicle = register(client)
    path = f"/api/vehicles/{vehicle['id']}"
    campaigns = [create_campaign_on(client, database, vehicle)]
    one = client.delete(path, params={"version": 1})
    assert (one.status_code, one.json()["detail"]) == (409, "Drone cannot be deleted: the campaign Real uses it.")
    assert "choose another vehicle" in one.json()["hint"]
    campaigns += [create_campaign_on(client, database, vehicle, name=name) for name in ("B", "C", "D")]
    four = client.delete(path, params={"version": 1})
    assert four.json()["detail"] == "Drone cannot be deleted: 4 campaigns use it: Real, B, C, …."
    for campaign in campaigns:
        gone = client.delete(f"/api/campaigns/{campaign['id']}", params={"version": campaign["version"]})
        assert gone.status_code == 204
    assert client.delete(path, params={"version": 1}).status_code == 204


def test_a_vehicle_in_quarantine_is_neither_deleted_nor_given_other_settings(
    client: TestClient, database: Database
) -> None:
    vehicle = register(client)
    path = f"/api/vehicles/{vehicle['id']}"
    with database.write() as session:
        commands.record_connected(
            session, vehicle["id"], ConnectionOpened(identity=IDENTITY, concern="Its gains are unknown.")
        )
        commands.record_disconnected(session, vehicle["id"])
    assert seen(client, vehicle)["actions"] == ["connect", "edit"]
    for refused in (
        client.delete(path, params={"version": 1}),
        client.patch(path, json={"version": 1, "options": {"system_id": 5}}),
    ):
        assert refused.status_code == 409
        assert refused.json()["detail"].startswith("Drone is quarantined: Its gains are unknown.")
    assert client.patch(path, json={"version": 1, "name": "Bee"}).status_code == 200
    assert seen(client, vehicle)["concern"] == "Its gains are unknown."


def test_a_vehicle_that_is_being_connected_is_neither_deleted_nor_given_other_settings(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    path = f"/api/vehicles/{vehicle['id']}"
    for state, word in ((VehicleState.READY, "connected"), (VehicleState.DISCONNECTED, "being connected")):
        put_into(state, database, vehicle)
        for refused in (
            client.delete(path, params={"version": 1}),
            client.patch(path, json={"version": 1, "options": {"system_id": 5}}),
        ):
            assert (refused.status_code, f"Drone is {word};" in refused.json()["detail"]) == (409, True)


def test_a_vehicle_that_was_deleted_meanwhile_is_not_reconnected(client: TestClient, database: Database) -> None:
    vehicle = register(client)
    assert client.delete(f"/api/vehicles/{vehicle['id']}", params={"version": 1}).status_code == 204
    with database.write() as session:
        assert not commands.record_reconnected(session, vehicle["id"], ConnectionOpened(identity=IDENTITY))
