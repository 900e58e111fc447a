"""Requests that a foreign page makes a browser send: to us, or under a name that only looks like ours."""

import pytest
from fastapi.testclient import TestClient

from tests.builders import get

NEW = {"name": "Test"}


@pytest.mark.parametrize("host", ["localhost:8000", "127.0.0.1:8000", "[::1]:8000", "192.168.0.7", "LOCALHOST"])
def test_names_and_addresses_of_this_machine_are_answered(client: TestClient, host: str) -> None:
    assert client.get("/api/health", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example:8000", "localhost.evil.example", "", "[::1"])
def test_a_foreign_name_for_this_machine_is_refused(client: TestClient, host: str) -> None:
    answer = client.get("/api/health", headers={"Host": host})
    assert answer.status_code == 403
    assert answer.headers["content-type"] == "application/problem+json"
    assert "GAINLINE_HOST" in answer.json()["hint"]


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:9999"},
        {"Sec-Fetch-Site": "cross-site"},
    ],
)
def test_whatever_a_foreign_page_asks_of_the_api_is_refused(client: TestClient, headers: dict[str, str]) -> None:
    answer = client.post("/api/campaigns", json=NEW, headers=headers)
    assert answer.status_code == 403
    assert answer.json()["hint"]
    assert get(client, "/api/campaigns")["total"] == 0
    assert client.post("/api/campaigns/1/finish", headers=headers).status_code == 403
    assert client.get("/api/campaigns", headers=headers).status_code == 403


def test_an_act_of_the_dashboard_itself_is_done(client: TestClient) -> None:
    own = {"Origin": "http://127.0.0.1:8000", "Host": "127.0.0.1:8000", "Sec-Fetch-Site": "same-origin"}
    assert client.post("/api/campaigns", json=NEW, headers=own).status_code == 201
