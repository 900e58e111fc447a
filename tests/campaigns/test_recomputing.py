"""A proposal computed again after a restart, in another process, from the stored flights: the same to the last bit."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

import pytest
from fastapi.testclient import TestClient

from app.campaigns import computation, proposals
from app.common.settings import Settings
from app.db.session import Database
from tests.builders import create_ready_campaign, create_trial, get, land, lift_off, run_jobs
from tests.campaigns.test_statistics import modelled
from tests.runtime.processes import environment

SCRIPT: Final = """
import sys
from pathlib import Path
from app.db.session import Database
from tests.campaigns.test_recomputing import told
for campaign_id in sys.argv[2:]:
    print(told(Database(Path(sys.argv[1])), int(campaign_id)))
"""
NOISE: Final = {"kind": "noise", "max_flights": 8}


def told(database: Database, campaign_id: int) -> str:
    """Everything that a worker computes from a campaign's history, as text; curves as the bytes of their samples."""
    with database.read() as session:
        past = proposals.read_history(session, campaign_id)
    computed = computation.compute(past)
    assert computed.proposal.predicted is not None
    curves = {name: values.tobytes().hex() for name, values in computed.proposal.predicted.channels.items()}
    parts: list[Any] = [
        computed.history_digest,
        computed.proposal.kind,
        computed.proposal.gains,
        repr(computed.proposal.predicted_error),
        repr(computed.proposal.interval),
        repr(computed.proposal.explanation),
        repr(computed.gate),
        repr(computed.stop_verdict),
        repr(computed.advice),
        curves,
    ]
    return json.dumps(parts)


@pytest.mark.complete
@pytest.mark.parametrize("strategy", ["gradient", "calibrated"])
def test_after_a_restart_the_same_history_gives_the_same_proposal_to_the_last_bit(
    client: TestClient, database: Database, settings: Settings, strategy: str
) -> None:
    campaign = create_ready_campaign(client, database, definition={"strategy": strategy, "stop": NOISE})
    identity = campaign["id"]
    for _ in range(2):
        trial = create_trial(client, identity, fly={"speed": None})
        land(database, lift_off(database), modelled(trial["gains"]))
        run_jobs(database)
    warm = client.post(f"/api/campaigns/{identity}/clone", json={"warm_start": True}).json()
    run_jobs(database)
    trial = create_trial(client, warm["id"], fly={"speed": None})
    land(database, lift_off(database), modelled(trial["gains"]))
    run_jobs(database)
    campaigns = [identity, warm["id"]]
    for found, elsewhere in zip(campaigns, recomputed(settings.database_file, campaigns), strict=True):
        here = told(database, found)
        stored = get(client, f"/api/campaigns/{found}/proposal")["proposal"]
        again = json.loads(here)
        assert (stored["history_digest"], stored["kind"], stored["gains"]) == tuple(again[:3])
        assert repr(stored["predicted_error"]) == again[3]
        assert elsewhere == here


def recomputed(file: Path, campaign_ids: list[int]) -> list[str]:
    """By another process."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(file), *map(str, campaign_ids)],
        env=environment(),
        cwd=Path(__file__).parents[2],
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
