"""The sentence about a finished flight."""

import re

from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import create_csv, create_imported_trial, create_ready_campaign, get, run_jobs

PATIENT = {"stop": {"kind": "budget", "max_flights": 9}}


def test_a_difference_is_told_only_where_the_printed_errors_differ(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=PATIENT)
    for settling_s in (1.0, 1.0001, 2.0):
        run_jobs(database)
        create_imported_trial(client, campaign["id"], create_csv(settling_s))
    trials = [get(client, f"/api/trials/{number}") for number in (1, 2, 3)]
    first, alike, slower = (trial["error"] for trial in trials)
    assert 0.0 < alike - first < 0.0005
    assert f"as good as the best before it (flight 1, {first:.3f} m)" in trials[1]["verdict"]
    share = 100 * (slower - first) / first
    told = re.escape(f"{slower - first:.3f} m ({share:.0f} %) worse than the best before it (flight 1, {first:.3f} m)")
    assert re.search(told, trials[2]["verdict"])
