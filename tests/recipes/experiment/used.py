"""The experiment is offered, and a campaign of two flights flown with it from the command line."""

import json
from pathlib import Path

from app.campaigns.catalogue import get_catalogue
from app.cli.commands import app

CAMPAIGN = """
name: Small steps
vehicle: {kind: twin, options: {scatter: 0.0}}
definition: {experiment: small-steps, stop: {kind: budget, max_flights: 2}}
"""


def test_the_second_flight_of_a_campaign_is_better_than_the_first(tmp_path: Path) -> None:
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    app(["run", str(tmp_path / "campaign.yaml"), "--json", str(tmp_path / "flown.json")], standalone_mode=False)
    first, second = [trial["error"] for trial in json.loads((tmp_path / "flown.json").read_text())["trials"]]
    assert second < first / 2.0


def test_it_is_offered() -> None:
    assert "small-steps" in [each.name for each in get_catalogue().experiments]
