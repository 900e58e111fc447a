"""The strategy is offered, and a campaign of two flights flown with it from the command line."""

import json
from pathlib import Path

from app.campaigns.catalogue import get_catalogue
from app.cli.commands import app

CAMPAIGN = """
name: Gentler
vehicle: {kind: twin, options: {scatter: 0.0}}
definition:
  strategy: gentler
  stop: {kind: budget, max_flights: 2}
  start: {kind: given, gains: {kp: 400, ki: 20, kd: 90}}
"""


def test_a_campaign_is_flown_with_it(tmp_path: Path) -> None:
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    app(["run", str(tmp_path / "campaign.yaml"), "--json", str(tmp_path / "flown.json")], standalone_mode=False)
    trials = json.loads((tmp_path / "flown.json").read_text())["trials"]
    assert [trial["gains"] for trial in trials] == [{"kp": 400, "ki": 20, "kd": 90}, {"kp": 400, "ki": 10, "kd": 90}]
    assert [trial["outcome"] for trial in trials] == ["valid", "valid"]


def test_it_is_offered() -> None:
    assert "gentler" in [each.name for each in get_catalogue().strategies]
