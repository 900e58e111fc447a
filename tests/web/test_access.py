"""Who may do what over HTTP: the caller's place and key against every route."""

import re
from collections.abc import Iterator

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from app.accounts.keys_and_links import Keyring
from app.accounts.permissions import Key
from app.common.settings import Settings
from app.db.session import Database
from app.main import create_app
from tests.builders import Json, create_campaign, create_csv, create_ready_campaign, create_trial, get, upload
from tests.builders import stage as stage_claimed
from tests.fleet.vehicles import (
    OUR_PAGE,
    SEEN,
    control_header,
    create_campaign_on,
    create_connected,
    register,
    take_control,
)
from tests.unlocking import HERE, client_here, new_link, unlock

NEIGHBOUR = ("192.0.2.9", 50000)
PROXIES = [
    {"X-Forwarded-For": "127.0.0.1"},
    {"X-Forwarded-Host": "127.0.0.1:8000"},
    {"Forwarded": "for=127.0.0.1"},
    {"Via": "1.1 tunnel"},
    {"X-Real-IP": "127.0.0.1"},
    {"CF-Connecting-IP": "127.0.0.1"},
    {"CF-Ray": "1"},
    {"True-Client-IP": "127.0.0.1"},
]
REAL = {"name": "Bee", "kind": "mavlink", "options": {}, **SEEN}


@pytest.fixture
def stranger(application: FastAPI, client: TestClient) -> TestClient:
    """Another program on this computer, which has opened no link; the application runs already."""
    return client_here(application)


@pytest.fixture
def neighbour(application: FastAPI, client: TestClient) -> TestClient:
    """A browser on another device."""
    return TestClient(application, base_url="http://192.0.2.7:8000", client=NEIGHBOUR, raise_server_exceptions=False)


@pytest.fixture
def real(client: TestClient, database: Database) -> Json:
    """A real vehicle that the client, who has opened a link, has registered and connected."""
    return create_connected(client, database, real=True)


def bearer(settings: Settings, key: Key) -> dict[str, str]:
    return {"Authorization": f"Bearer {Keyring(settings.data_dir).value(key)}"}


def test_before_a_link_is_opened_a_browser_may_do_all_but_command_real_vehicles(client: TestClient) -> None:
    asked = get(client, "/api/access")
    assert (asked["elsewhere"], asked["may_change"], asked["may_link"], asked["may_command"]) == (
        False, True, True, False)  # fmt: skip
    assert "gainline unlock" in asked["hint"]
    refused = client.post("/api/vehicles", json=REAL, headers=OUR_PAGE)
    assert (refused.status_code, refused.json()["title"]) == (403, "Not allowed")
    assert "gainline unlock" in refused.json()["hint"]
    assert get(client, "/api/vehicles")["total"] == 0
    create_campaign(client)
    register(client)


def test_a_link_is_exchanged_for_a_cookie_that_no_script_and_no_other_site_can_use(
    client: TestClient, settings: Settings
) -> None:
    opened = client.get(new_link(settings.data_dir), follow_redirects=False)
    assert (opened.status_code, opened.headers["location"]) == (303, "/?unlocked")
    cookie = opened.headers["set-cookie"].lower()
    assert {"httponly", "samesite=strict", "path=/"} <= set(re.split(r"; ?", cookie))
    assert opened.headers["referrer-policy"] == "no-referrer"
    assert opened.headers["cache-control"] == "no-store"
    assert get(client, "/api/access") == {
        "elsewhere": False, "may_change": True, "may_link": True, "may_command": True, "hint": ""}  # fmt: skip
    assert client.post("/api/vehicles", json=REAL).status_code == 201


def test_a_used_link_unlocks_no_other_browser_and_shows_how_to_get_another(
    client: TestClient, stranger: TestClient, settings: Settings
) -> None:
    link = new_link(settings.data_dir)
    assert client.get(link, follow_redirects=False).status_code == 303
    assert client.get(link, follow_redirects=False).status_code == 303  # opened twice in the same browser
    refused = stranger.get(link, follow_redirects=False)
    assert refused.status_code == 403
    assert "set-cookie" not in refused.headers
    assert "gainline unlock" in refused.text
    assert "it cannot command real vehicles from this browser" in refused.text
    assert not get(stranger, "/api/access")["may_command"]


@pytest.mark.complete
@pytest.mark.parametrize("what", ["rename", "finish", "archive", "delete"])
def test_a_campaign_on_a_real_vehicle_is_changed_with_a_key_only(
    what: str, client: TestClient, database: Database, stranger: TestClient, real: Json
) -> None:
    campaign = create_campaign_on(client, database, real)
    path = f"/api/campaigns/{campaign['id']}"
    refused = {
        "rename": lambda: stranger.patch(path, json={"version": campaign["version"], "name": "Mine"}),
        "finish": lambda: stranger.post(f"{path}/finish", json={}),
        "archive": lambda: stranger.post(f"{path}/archive"),
        "delete": lambda: stranger.delete(f"{path}?version={campaign['version']}"),
    }[what]()
    assert (refused.status_code, refused.json()["title"]) == (403, "Not allowed")
    assert get(client, path)["name"] == campaign["name"]
    assert client.patch(path, json={"version": campaign["version"], "name": "Ours"}).status_code == 200


def test_a_cookie_that_somebody_put_beside_ours_does_not_hide_it(client: TestClient, settings: Settings) -> None:
    keyring = Keyring(settings.data_dir)
    name, value = keyring.cookie, keyring.value(Key.BROWSER)
    for cookies in (f"{name}=x; {name}={value}", f"{name}={value}; {name}=x"):
        assert client.get("/api/access", headers={"Cookie": cookies}).json()["may_command"]
    for cookies in (f"{name}=x", f"other={value}", f"{name}={value[:-1]}"):
        assert not client.get("/api/access", headers={"Cookie": cookies}).json()["may_command"]


@pytest.mark.parametrize("headers", [*PROXIES, {"Host": "192.168.0.7:8000"}], ids=lambda given: next(iter(given)))
def test_a_key_is_worth_nothing_through_a_proxy_or_under_another_name(
    client: TestClient, headers: dict[str, str]
) -> None:
    unlock(client)
    assert client.post("/api/vehicles", json=REAL, headers=OUR_PAGE).status_code == 201
    refused = client.post("/api/vehicles", json={**REAL, "name": "Wasp"}, headers={**OUR_PAGE, **headers})
    assert refused.status_code == 403
    assert "it accepts commands from this computer only" in refused.json()["detail"]
    assert client.get("/api/access", headers=headers).json()["elsewhere"]
    assert get(client, "/api/vehicles")["total"] == 1


def acts_on(vehicle: Json) -> list[tuple[str, str, Json | None]]:
    """Every way to command a vehicle, by method, path and body."""
    path = f"/api/vehicles/{vehicle['id']}"
    return [
        ("PUT", f"{path}/control", {"operator": "Mallory", "take_over": True}),
        *(("POST", f"{path}/{act}", {}) for act in ("check", "restore", "parameters", "disconnect", "motors-off")),
        ("POST", f"{path}/release", {"statement": "I looked"}),
        ("PATCH", path, {"version": vehicle["version"], "name": "Mine"}),
        ("DELETE", f"{path}?version={vehicle['version']}", None),
    ]


@pytest.mark.complete
def test_whoever_has_no_key_commands_no_real_vehicle_whatever_the_headers_say(
    stranger: TestClient, client: TestClient, database: Database, real: Json
) -> None:
    planned = create_trial(client, create_campaign_on(client, database, real)["id"])
    asked = [
        *acts_on(real),
        ("POST", f"/api/campaigns/{planned['campaign_id']}/trials", {"gains": planned["gains"]}),
        ("POST", f"/api/trials/{planned['id']}/stage", {}),
        ("POST", f"/api/trials/{planned['id']}/fly", {}),
        ("POST", f"/api/trials/{planned['id']}/classify", {"version": 1, "outcome": "valid", "reason": "mine"}),
        ("POST", f"/api/trials/{planned['id']}/judge-abort", {"version": 1, "cause": "something else"}),
    ]
    page = {**OUR_PAGE, "Origin": "http://127.0.0.1:8000"}
    for method, path, body in asked:
        if path.endswith("/release"):
            continue  # it is not quarantined, which is told first
        refused = stranger.request(method, path, json=body, headers=page)
        assert (refused.status_code, refused.json()["title"]) == (403, "Not allowed"), path
        assert "real vehicle" in refused.json()["detail"], path
    refused = upload(stranger, planned["id"], create_csv())
    assert (refused.status_code, refused.json()["title"]) == (403, "Not allowed")
    assert get(client, f"/api/vehicles/{real['id']}")["control"] is None


def test_motors_off_of_a_real_vehicle_needs_the_key_and_then_no_database(
    stranger: TestClient, client: TestClient, database: Database, real: Json
) -> None:
    simulated = register(client, "Simulated")
    assert stranger.post(f"/api/vehicles/{real['id']}/motors-off").status_code == 403
    assert stranger.post(f"/api/vehicles/{simulated['id']}/motors-off").status_code == 202
    with database.write():  # and the operator waits for nobody who writes
        assert client.post(f"/api/vehicles/{real['id']}/motors-off").status_code == 202
    assert client.post("/api/vehicles/4711/motors-off").status_code == 202
    assert stranger.post("/api/vehicles/4711/motors-off").status_code == 404


def test_abort_and_land_of_a_real_vehicle_need_no_key_here(
    stranger: TestClient, client: TestClient, database: Database, real: Json
) -> None:
    trial = create_trial(client, create_campaign_on(client, database, real)["id"])
    assert client.post(f"/api/trials/{trial['id']}/stage").status_code == 202
    assert stranger.post(f"/api/vehicles/{real['id']}/land").status_code == 202
    assert stranger.post(f"/api/trials/{trial['id']}/abort").json()["accepted"]


@pytest.mark.complete
def test_a_scripts_token_stages_a_real_vehicle_and_does_not_take_it_off(
    stranger: TestClient, client: TestClient, database: Database, settings: Settings, real: Json
) -> None:
    trial = create_trial(client, create_campaign_on(client, database, real)["id"])
    script = bearer(settings, Key.SCRIPT)
    assert stranger.post(f"/api/trials/{trial['id']}/stage", headers=script).status_code == 202
    stage_claimed(database)
    lease = {**script, **control_header(client, real)}
    path = f"/api/trials/{trial['id']}/take-off"
    for headers in (lease, {**lease, **OUR_PAGE}):
        refused = stranger.post(path, headers=headers)
        assert refused.status_code == 403
        assert "only its operator can start the takeoff, in an unlocked browser" in refused.json()["detail"]
    without_cookie = stranger.post(path, headers={**OUR_PAGE, **control_header(client, real)})
    assert without_cookie.status_code == 403
    refused = client.post(path, headers={**OUR_PAGE, **control_header(client, real)})
    assert (refused.status_code, "The worker is not responding" in refused.json()["detail"]) == (409, True), "may, but"


def test_from_another_device_one_looks_and_changes_nothing_without_a_key(
    neighbour: TestClient, client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    assert get(neighbour, "/api/campaigns")["total"] == 1
    for path in ("/api/campaigns", f"/api/campaigns/{campaign['id']}/finish", "/api/trials/1/abort"):
        refused = neighbour.post(path, json={"name": "Mine"} if path == "/api/campaigns" else None)
        assert refused.status_code == 403
        assert "192.0.2.9" in refused.json()["detail"]
    for path in ("system/backup", f"campaigns/{campaign['id']}/bundle", f"campaigns/{campaign['id']}/report.pdf"):
        assert neighbour.get(f"/api/{path}").status_code == 403
    assert get(neighbour, f"/api/campaigns/{campaign['id']}/figures/landscape")["state"] == "waiting"
    assert [job["kind"] for job in get(client, "/api/jobs")["items"]] == ["proposal"]


@pytest.mark.parametrize("with_link", [True, False], ids=["browser", "script"])
def test_a_key_of_another_device_changes_campaigns_and_commands_nothing_real(
    neighbour: TestClient, stranger: TestClient, settings: Settings, real: Json, with_link: bool
) -> None:
    headers = {} if with_link else bearer(settings, Key.REMOTE)
    if with_link:
        assert neighbour.get(new_link(settings.data_dir), follow_redirects=False).status_code == 303
    assert neighbour.post("/api/campaigns", json={"name": "From the tablet"}, headers=headers).status_code == 201
    for method, path, body in acts_on(real):
        if not path.endswith("/release"):
            assert neighbour.request(method, path, json=body, headers=headers).status_code == 403, path
    # The same key brought to this computer is worth no more.
    cookie = {"Cookie": "; ".join(f"{name}={value}" for name, value in neighbour.cookies.items())}
    carried = stranger.post(f"/api/vehicles/{real['id']}/restore", headers=cookie if with_link else headers)
    assert carried.status_code == 403


@pytest.fixture
def exposed(settings: Settings, client: TestClient) -> Iterator[TestClient]:
    """A browser on the computer of a server that others reach too, unlocked."""
    application = create_app(settings.model_copy(update={"host": "0.0.0.0"}))
    with TestClient(application, base_url="http://127.0.0.1:8000", client=HERE) as network:
        unlock(network)
        yield network


@pytest.mark.complete
def test_a_server_that_others_reach_has_no_links_whoever_asks(
    exposed: TestClient, client: TestClient, database: Database
) -> None:
    vehicle = register(client, options={"simulated": True})
    for simulated, option in (
        (True, {}),
        (False, {}),
        (True, {"second_source": "mavlink:udpin:0.0.0.0:14600"}),
        (True, {"log_folder": "/etc"}),
        (True, {"signing_key_file": "/etc/shadow"}),
    ):
        options = {"simulated": simulated, **option}
        body = {"name": "Wasp", "kind": "mavlink", "options": options, **SEEN}
        assert exposed.post("/api/vehicles", json=body).status_code == 403
        edit = {"version": vehicle["version"], "options": options}
        assert exposed.patch(f"/api/vehicles/{vehicle['id']}", json=edit).status_code == 403
    refused = exposed.post(f"/api/vehicles/{vehicle['id']}/connect")
    assert (refused.status_code, "connected over a link" in refused.json()["detail"]) == (403, True)
    assert take_control(exposed, vehicle).status_code == 403
    connected = create_connected(client, database, "Connected")
    trial = create_trial(client, create_campaign_on(client, database, connected)["id"])
    for act in ("stage", "fly"):
        assert exposed.post(f"/api/trials/{trial['id']}/{act}").status_code == 403
    assert exposed.post("/api/campaigns", json={"name": "Simulated"}).status_code == 201
    assert get(exposed, "/api/access")["may_link"] is False


@pytest.mark.parametrize(
    "headers",
    [{"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "same-site"}, {"Origin": "http://evil.example"},
     {"Host": "evil.example"}],
)  # fmt: skip
def test_a_page_of_another_site_starts_no_work(client: TestClient, database: Database, headers: dict[str, str]) -> None:
    """Not even by pictures and links, which are read without asking."""
    campaign = create_ready_campaign(client, database)
    jobs = get(client, "/api/jobs")["total"]
    parts = ("figures/landscape", "figures/takeoffs", "report.html", "report.pdf", "bundle", "statistics")
    for path in ("system/backup", *(f"campaigns/{campaign['id']}/{part}" for part in parts)):
        answer = client.get(f"/api/{path}", headers=headers)
        assert (answer.status_code, answer.headers["content-type"]) == (403, "application/problem+json"), path
    assert get(client, "/api/jobs")["total"] == jobs


def changes(application: FastAPI) -> list[tuple[str, str]]:
    """Every way to change something, by method and path."""
    paths = application.openapi()["paths"]
    return [
        (method.upper(), re.sub(r"\{\w+\}", "1", path))
        for path, operations in paths.items()
        for method in operations
        if method != "get"
    ]


@pytest.mark.complete
def test_every_change_in_the_api_is_refused_to_a_stranger(application: FastAPI, neighbour: TestClient) -> None:
    found = changes(application)
    assert len(found) > 30
    for method, path in found:
        refused = neighbour.request(method, path)
        assert (refused.status_code, refused.json()["title"]) == (403, "Not allowed"), f"{method} {path}"
