"""The presets of the paper's method, flown by whoever does nothing but follow the recommendation."""

from contextlib import closing

import pytest
from fastapi.testclient import TestClient

from app.common.settings import Settings
from app.db.session import Database
from tests.builders import get, run_jobs
from tests.e2e.states import States

NOT_IMPROVING = "The last 2 consecutive flights did not improve on the best before them by more than 5\u00a0%."


@pytest.mark.complete
@pytest.mark.parametrize(
    ("preset", "flights", "reason"),
    [
        ("paper-ardrone-takeoff", 6, NOT_IMPROVING),
        ("paper-ardrone-takeoff-simplex", 2, "The model predicts no improvement over the best flight."),
        ("paper-f16-pitch-tracking", 27, "All 27 flights of the budget have been flown."),
    ],
)
def test_the_papers_method_is_flown_to_its_stop_by_its_recommendations_alone(
    client: TestClient, database: Database, settings: Settings, preset: str, flights: int, reason: str
) -> None:
    """Reported: *Repeat* was preselected after flight 3, and from the simplex start the advice after flight 1 was to
    stop."""
    [offered] = [each for each in get(client, "/api/catalogue")["presets"] if each["name"] == preset]
    path = f"/api/campaigns/{client.post('/api/campaigns', json=offered['campaign']).json()['id']}"
    run_jobs(database)
    with closing(States(settings.data_dir)) as states:
        while get(client, path)["state"] != "finished":
            choices = get(client, f"{path}/proposal")["proposal"]["choices"]
            assert [choice["proposed"] for choice in choices if choice["recommended"]] == [True]
            states.fly(get(client, path)["id"])
    trials = get(client, f"{path}/trials")["items"]
    assert [trial["state"] for trial in trials] == ["valid"] * flights
    assert [trial["kind"] for trial in trials if trial["kind"] not in {"step", "shorter step"}] == ["start"]
    assert len({tuple(trial["gains"].values()) for trial in trials}) == flights, "no gains were flown twice"
    assert get(client, path)["stop_reason"] == reason
