"""A campaign with something to tell: a name that tries to be a script, a flight that does not count, a best one."""

import pytest
from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import (
    Json,
    create_ready_campaign,
    create_record,
    fly_trial,
    get,
    made_once,
    run_jobs,
)

NAME = "<script>alert('name')</script> & <b>wing</b>"
REASON = "<img src=x onerror=alert(1)> gust"


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    return made_once(database, "three flights, one ruled out", lambda: make_campaign(client, database))


def make_campaign(client: TestClient, database: Database) -> Json:
    """Three flights on the twin with known errors, the second one ruled out."""
    ready = create_ready_campaign(client, database, name=NAME, definition={"stop": {"kind": "budget"}})
    for kd, settling_s in ((82, 1.5), (90, 1.2), (98, 0.9)):
        fly_trial(client, database, ready["id"], create_record(settling_s), gains={"kp": 283, "ki": 13, "kd": kd})
    second = get(client, f"/api/campaigns/{ready['id']}/trials")["items"][1]
    said = {"version": second["version"], "outcome": "invalid", "reason": REASON}
    assert client.post(f"/api/trials/{second['id']}/classify", json=said).status_code == 200
    run_jobs(database)
    found: Json = get(client, f"/api/campaigns/{ready['id']}")
    return found
