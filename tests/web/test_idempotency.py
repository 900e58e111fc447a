"""The same request twice is the same act; people in a hurry, in threads, lose nothing."""

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest
from fastapi.testclient import TestClient

from app.db.base import utc_now
from app.db.models import CampaignRow, IdempotencyRow, TrialRow
from app.db.session import KEPT_ANSWERS, Database
from tests.builders import (
    create_campaign,
    create_ready_campaign,
    create_record,
    create_trial,
    get,
    land,
    lift_off,
    problems_of,
)

KEY = {"Idempotency-Key": "one act"}


def test_the_same_request_with_the_same_key_is_carried_out_once(client: TestClient, database: Database) -> None:
    first, second = (client.post("/api/campaigns", json={"name": "Once"}, headers=KEY) for _ in range(2))
    assert first.status_code == second.status_code == 201
    assert first.json() == second.json()
    with database.read() as session:
        assert session.query(CampaignRow).count() == 1


def test_without_a_key_every_request_is_an_act(client: TestClient) -> None:
    assert create_campaign(client)["id"] != create_campaign(client)["id"]


@pytest.mark.parametrize("other", [("/api/campaigns", {"name": "Twice"}), ("/api/campaigns/1/finish", None)])
def test_a_key_that_stands_for_another_request_is_refused(client: TestClient, other: tuple[str, object]) -> None:
    client.post("/api/campaigns", json={"name": "Once"}, headers=KEY)
    path, body = other
    answer = client.post(path, json=body, headers=KEY) if body else client.post(path, headers=KEY)
    assert answer.status_code == 422
    assert problems_of(answer) == {"Idempotency-Key": "belongs to another request"}


@pytest.mark.complete
def test_a_refused_request_may_be_tried_again_with_its_key(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    busy = create_trial(client, campaign["id"], fly={"speed": None})
    other = create_ready_campaign(client, database)
    ask = {"gains": {"kp": 283, "ki": 13, "kd": 82}, "fly": {"speed": None}}
    path = f"/api/campaigns/{other['id']}/trials"
    assert client.post(path, json=ask, headers=KEY).status_code == 409
    land(database, lift_off(database), create_record())
    assert get(client, f"/api/trials/{busy['id']}")["state"] == "valid"
    assert client.post(path, json=ask, headers=KEY).status_code == 201


def test_an_answer_is_given_again_as_it_was_though_the_world_has_moved_on(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    ask = {"gains": {"kp": 283, "ki": 13, "kd": 82}, "fly": {"speed": None}}
    path = f"/api/campaigns/{campaign['id']}/trials"
    first = client.post(path, json=ask, headers=KEY)
    land(database, lift_off(database), create_record())
    assert client.post(path, json=ask, headers=KEY).json() == first.json()
    assert get(client, path)["total"] == 1


@pytest.mark.parametrize("key", ["", "x" * 201])
def test_a_key_that_is_none_is_refused(client: TestClient, key: str) -> None:
    answer = client.post("/api/campaigns", json={"name": "a"}, headers={"Idempotency-Key": key})
    assert answer.status_code == 422
    assert "Idempotency-Key" in problems_of(answer)


def test_old_keys_are_forgotten(client: TestClient, database: Database) -> None:
    client.post("/api/campaigns", json={"name": "a"}, headers={"Idempotency-Key": "old"})
    with database.write() as session:
        session.get_one(IdempotencyRow, "old").created_at = utc_now() - KEPT_ANSWERS - timedelta(seconds=1)
    client.post("/api/campaigns", json={"name": "b"}, headers={"Idempotency-Key": "new"})
    with database.read() as session:
        assert [row.key for row in session.query(IdempotencyRow)] == ["new"]


@pytest.mark.complete
def test_the_same_key_from_many_threads_at_once_makes_one_campaign(client: TestClient, database: Database) -> None:
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: client.post("/api/campaigns", json={"name": "Once"}, headers=KEY), range(24)))
    assert {answer.status_code for answer in answers} == {201}
    assert len({answer.json()["id"] for answer in answers}) == 1


@pytest.mark.complete
def test_many_threads_writing_at_once_lose_nothing(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"max_flights": 16}})
    path = f"/api/campaigns/{campaign['id']}/trials"

    def plan(index: int) -> int:
        return client.post(path, json={"gains": {"kp": 283 + index, "ki": 13, "kd": 82}}).status_code

    with ThreadPoolExecutor(8) as pool:
        statuses = list(pool.map(plan, range(16)))
    assert statuses == [201] * 16
    with database.read() as session:
        found = session.query(TrialRow).order_by(TrialRow.number).all()
    assert [row.number for row in found] == list(range(1, 17))
    assert {row.gains["kp"] for row in found} == {283 + index for index in range(16)}


def test_many_threads_that_want_one_vehicle_get_one_flight(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}/trials"
    ask = {"gains": {"kp": 283, "ki": 13, "kd": 82}, "fly": {"speed": None}}
    with ThreadPoolExecutor(8) as pool:
        statuses = list(pool.map(lambda _: client.post(path, json=ask).status_code, range(16)))
    assert sorted(statuses) == [201] + [409] * 15
    assert get(client, path)["total"] == 1
