"""Names that would rewrite a terminal's lines, or pass for other names: refused, wherever a name is given."""

import pytest
from fastapi.testclient import TestClient

from app.common.schemas import find_control_characters, uploaded_name
from tests.builders import create_campaign, problems_of
from tests.fleet.vehicles import register

CONTROLS = ["\x1b[2J", "\x00", "\x07", "\n", "\x7f", "\x9b31m", "\u202e", "\u2066", "\u200f", "\u2028"]


@pytest.mark.parametrize("control", CONTROLS, ids=ascii)
def test_a_name_with_a_control_character_is_refused_wherever_one_is_given(client: TestClient, control: str) -> None:
    name = f"Bee{control}Wasp"
    campaign, vehicle = create_campaign(client), register(client)
    refusals = {
        "a new campaign": client.post("/api/campaigns", json={"name": name}),
        "a campaign": client.patch(f"/api/campaigns/{campaign['id']}", json={"version": 1, "name": name}),
        "a new vehicle": client.post(
            "/api/vehicles", json={"name": name, "kind": "mavlink", "options": {"simulated": True}}
        ),
        "a vehicle": client.patch(f"/api/vehicles/{vehicle['id']}", json={"version": 1, "name": name}),
        "a battery": client.patch(f"/api/vehicles/{vehicle['id']}", json={"version": 1, "battery": name}),
        "an operator": client.put(f"/api/vehicles/{vehicle['id']}/control", json={"operator": name}),
    }
    for what, answer in refusals.items():
        assert answer.status_code == 422, what
        (reason,) = problems_of(answer).values()
        assert reason == f"must not contain control characters (U+{ord(control[0]):04X})", what


@pytest.mark.parametrize("name", ["Größe 3", "無人機", "طائرة", "Bee 🐝", "Ada – no. 3"])
def test_names_of_every_language_are_taken(client: TestClient, name: str) -> None:
    assert create_campaign(client, name=name)["name"] == name


def test_each_control_character_is_reported_once() -> None:
    assert find_control_characters("a\x1bb\x00c\x1b") == ("U+0000", "U+001B")


def test_the_name_of_a_file_loses_them() -> None:
    assert uploaded_name("folder/\x1b[2Jflight\u202e.data", unnamed="recording") == "[2Jflight.data"
