"""How fast a simulated flight may be asked to run."""

import pytest
from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import create_ready_campaign, problems_of

GAINS = {"kp": 283, "ki": 13, "kd": 82}


@pytest.mark.parametrize("speed", [0.0, 1e-300, 0.001, 0.099, -1.0, 1000.1, 1e300])
def test_a_speed_too_high_to_watch_is_refused_by_name(client: TestClient, database: Database, speed: float) -> None:
    campaign = create_ready_campaign(client, database)
    refused = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"gains": GAINS, "fly": {"speed": speed}})
    assert refused.status_code == 422
    assert list(problems_of(refused)) == ["fly.speed"]
