"""The figure of a campaign, over HTTP."""

from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import create_flown_campaign, create_ready_campaign, get


def test_it_waits_for_a_flight(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    card = get(client, f"/api/campaigns/{campaign['id']}/figures/order")
    assert (card["state"], card["reason"]) == ("waiting", "The order appears after the first flight.")


def test_it_is_drawn_with_its_table(client: TestClient, database: Database) -> None:
    campaign = create_flown_campaign(client, database)
    card = get(client, f"/api/campaigns/{campaign['id']}/figures/order")
    assert (card["state"], card["table"]["rows"][0]) == ("ready", [1, 1])
