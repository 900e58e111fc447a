"""Whole campaigns without a database."""

import pytest

from app.campaigns import headless
from app.campaigns.headless import CampaignListener, fly_campaign
from app.core.definition import Definition, StopRule
from app.core.experiments.base import Experiment
from app.core.records.glitches import Glitch
from app.core.records.trajectory import Trajectory

SPIKE = Glitch(kind="acceleration", start_s=1.0, end_s=1.1, sentence="The altitude jumps.")


def test_a_low_battery_ends_a_campaign_whose_flights_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """The twin's battery holds 11.1 V; every record has a glitch, and no person reviews it."""

    def always_one(_experiment: Experiment, _record: Trajectory) -> tuple[Glitch, ...]:
        return (SPIKE,)

    monkeypatch.setattr(headless, "find_glitches", always_one)
    definition = Definition(stop=StopRule(kind="budget", max_flights=3, min_battery_v=11.5))
    flown = fly_campaign(definition, "twin", {}, CampaignListener())
    assert [trial.outcome for trial in flown.trials] == ["invalid"]
    assert flown.stopped_because.startswith("The last flight ended at 11.10 V; the minimum is 11.5 V.")
