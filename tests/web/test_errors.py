"""Problem documents: every refusal says what happened, what to do, and which field is to blame."""

import base64
import errno
import sqlite3

import pytest
from fastapi.testclient import TestClient
from httpx2 import Response
from sqlalchemy import text

from app.common import errors
from app.common.settings import Settings
from app.core.errors import GainlineError
from app.db.session import Database
from app.main import create_app
from tests.builders import create_campaign, create_ready_campaign, get, problems_of
from tests.conftest import Listen
from tests.unlocking import client_here

CAMPAIGN = "/api/campaigns"


def is_problem(answer: Response) -> bool:
    body = answer.json()
    return (
        answer.headers["content-type"] == "application/problem+json"
        and body["status"] == answer.status_code
        and bool(body["detail"])
        and bool(body["hint"])
    )


@pytest.mark.parametrize(
    "path",
    [
        "/api/campaigns/999",
        "/api/campaigns/999/proposal",
        "/api/campaigns/999/trials",
        "/api/trials/999",
        "/api/trials/999/trajectory",
        "/api/trials/999/trajectory.csv",
        "/api/jobs/999",
        "/api/vehicles/999",
        "/api/vehicles/999/ledger",
        "/api/nothing",
        "/api/",
        "/api",
    ],
)
def test_what_does_not_exist_is_404_with_a_hint(client: TestClient, path: str) -> None:
    answer = client.get(path)
    assert answer.status_code == 404
    assert is_problem(answer)


@pytest.mark.parametrize(
    "path",
    [
        "/api/campaigns/999/finish",
        "/api/campaigns/999/archive",
        "/api/campaigns/999/clone",
        "/api/campaigns/999/proposal",
        "/api/trials/999/fly",
        "/api/trials/999/abort",
        "/api/trials/999/cancel",
        "/api/jobs/999/cancel",
        "/api/jobs/999/retry",
    ],
)
def test_acts_on_what_does_not_exist_are_404(client: TestClient, path: str) -> None:
    answer = client.post(path)
    assert answer.status_code == 404
    assert is_problem(answer)


@pytest.mark.parametrize("identity", ["0", "-1", "abc", "1.5", str(2**63)])
def test_an_id_that_cannot_be_one_is_refused_by_field(client: TestClient, identity: str) -> None:
    answer = client.get(f"{CAMPAIGN}/{identity}")
    assert answer.status_code == 422
    assert "campaign_id" in problems_of(answer)


def test_an_unknown_method_is_405(client: TestClient) -> None:
    answer = client.put(CAMPAIGN, json={})
    assert answer.status_code == 405
    assert is_problem(answer)
    assert "GET" in answer.headers["allow"]


@pytest.mark.parametrize(
    ("content", "kind", "status"),
    [
        (b"name=a", "application/x-www-form-urlencoded", 415),
        (b"{}", "text/plain", 415),
        (b"{", "application/json", 422),
        (b"", "application/json", 422),
        (b"[1]", "application/json", 422),
        (b"null", "application/json", 422),
        (b'{"name": NaN}', "application/json", 422),
        (b'{"name": "\\ud800"}', "application/json", 422),
        (b"\xff\xfe", "application/json", 422),
        (b'{"name": "' + b"x" * 2**20 + b'"}', "application/json", 413),
        (b'{"name": "a", "definition": {"options": {"scaled": "\\ud800"}}}', "application/json", 422),
        (b"[" * 100_000, "application/json", 400),
    ],
)
def test_a_body_that_is_no_request_is_refused(client: TestClient, content: bytes, kind: str, status: int) -> None:
    answer = client.post(CAMPAIGN, content=content, headers={"Content-Type": kind})
    assert answer.status_code == status, answer.text
    assert is_problem(answer)


GAINS = [
    ({"kp": -1, "ki": 13, "kd": 82}, "gains.kp"),
    ({"kp": 283.5, "ki": 13, "kd": 82}, "gains.kp"),
    ({"kp": 4001, "ki": 13, "kd": 82}, "gains.kp"),
    ({"kp": 283, "ki": 13}, "gains.kd"),
    ({"kp": 283, "ki": 13, "kd": 82, "kx": 1}, "gains.kx"),
    ({"kp": "283", "ki": 13, "kd": 82}, "gains.kp"),
    ({"kp": None, "ki": 13, "kd": 82}, "gains.kp"),
    ({"kp": True, "ki": 13, "kd": 82}, "gains.kp"),
    ({"kp": 10**400, "ki": 13, "kd": 82}, "gains.kp"),
    ({"kp": 3000, "ki": 13, "kd": 82}, "gains.kp"),
    ({}, "gains.kp"),
]


@pytest.mark.parametrize(("gains", "field"), GAINS)
def test_gains_that_may_not_fly_are_refused_by_field(
    client: TestClient, database: Database, gains: object, field: str
) -> None:
    campaign = create_ready_campaign(client, database)
    answer = client.post(f"{CAMPAIGN}/{campaign['id']}/trials", json={"gains": gains})
    assert answer.status_code == 422
    assert field in problems_of(answer)
    assert get(client, f"{CAMPAIGN}/{campaign['id']}/trials")["total"] == 0


def test_half_a_character_is_refused_by_field(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    answer = client.post(
        f"{CAMPAIGN}/{campaign['id']}/trials",
        headers={"Content-Type": "application/json"},
        content=b'{"gains": {"\\ud800": 1}}',
    )
    assert (answer.status_code, is_problem(answer)) == (422, True)
    options = b'{"name": "a", "vehicle": {"kind": "twin", "options": {"\\ud800": 1}}}'
    answer = client.post(CAMPAIGN, headers={"Content-Type": "application/json"}, content=options)
    assert (answer.status_code, is_problem(answer)) == (422, True)


def test_a_number_that_no_float_can_hold_is_refused_by_field(client: TestClient) -> None:
    options = {"kind": "twin", "options": {"scatter": 10**400}}
    answer = client.post(CAMPAIGN, json={"name": "a", "vehicle": options})
    assert answer.status_code == 422
    assert problems_of(answer)["vehicle.options.scatter"].startswith("must be a finite number, got 1000")


@pytest.mark.parametrize("path", ["/api/campaigns?sort=error", "/api/jobs?limit=5", "/api/campaigns?sort=-created"])
def test_a_cursor_with_a_number_that_no_float_can_hold_is_refused(client: TestClient, path: str) -> None:
    order = {"/api/campaigns?sort=error": "error", "/api/campaigns?sort=-created": "-created"}.get(path, "-id")
    huge = base64.urlsafe_b64encode(f'["{order}", {"9" * 330}, 1]'.encode()).decode().rstrip("=")
    assert client.get(f"{path}&cursor={huge}").status_code == 422


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_none_are_refused_by_field(client: TestClient, database: Database, number: str) -> None:
    campaign = create_ready_campaign(client, database)
    answer = client.post(
        f"{CAMPAIGN}/{campaign['id']}/trials",
        headers={"Content-Type": "application/json"},
        content=f'{{"gains": {{"kp": {number}, "ki": 13, "kd": 82}}}}',
    )
    assert answer.status_code == 422
    assert "gains.kp" in problems_of(answer)


def test_the_gate_says_how_far_the_gains_may_go(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    answer = client.post(f"{CAMPAIGN}/{campaign['id']}/trials", json={"gains": {"kp": 3000, "ki": 13, "kd": 82}})
    assert answer.json()["title"] == "Gains refused"
    assert problems_of(answer)["gains.kp"] == (
        "kp changes most, by 67.9\u00a0% of its range; only 25\u00a0% is allowed from the start gains "
        "before the first valid flight."
    )


def test_another_campaigns_proposal_is_not_found(client: TestClient, database: Database) -> None:
    first, second = (create_ready_campaign(client, database)["id"] for _ in range(2))
    theirs = get(client, f"{CAMPAIGN}/{first}/proposal")["proposal"]["id"]
    assert client.post(f"{CAMPAIGN}/{second}/trials", json={"proposal_id": theirs}).status_code == 404


@pytest.mark.complete
def test_a_full_disk_is_503_and_loses_nothing(client: TestClient, database: Database, listen: Listen) -> None:
    campaign = create_campaign(client)
    with database.engine.connect() as connection:
        pages = connection.execute(text("PRAGMA page_count")).scalar()
    database.engine.dispose()

    def fill_up(connection: sqlite3.Connection, _entry: object) -> None:
        connection.execute(f"PRAGMA max_page_count = {pages}")

    listen(database.engine, "connect", fill_up)
    answers = [client.post(CAMPAIGN, json={"name": "x" * 120}) for _ in range(60)]
    refused = [answer for answer in answers if answer.status_code != 201]
    assert refused
    assert {answer.status_code for answer in refused} == {503}
    assert all(is_problem(answer) and "Free some disk space" in answer.json()["hint"] for answer in refused)
    kept = get(client, f"{CAMPAIGN}?limit=200")["items"]
    assert len(kept) == 1 + len(answers) - len(refused)
    assert kept[-1]["id"] == campaign["id"]


def test_a_full_disk_outside_of_the_database_is_503_too(settings: Settings) -> None:
    application = create_app(settings)

    @application.get("/api/full")
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with client_here(application) as client:
        answer = client.get("/api/full")
    assert (answer.status_code, is_problem(answer)) == (503, True)


def test_a_mistake_of_ours_is_500_with_a_number(settings: Settings) -> None:
    application = create_app(settings)

    @application.get("/api/mistake")
    def mistake() -> None:
        raise ZeroDivisionError

    with client_here(application) as client:
        answer = client.get("/api/mistake")
    assert (answer.status_code, is_problem(answer)) == (500, True)
    assert "ZeroDivisionError" not in answer.text


def test_every_error_is_drawn_in_the_trees_docstring() -> None:
    kinds = {
        kind.__name__ for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, GainlineError)
    }
    assert errors.__doc__ is not None
    assert {name for name in kinds if name not in errors.__doc__} == set()
