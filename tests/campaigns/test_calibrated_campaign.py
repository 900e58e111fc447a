"""Whole campaigns of the calibrated strategy on simulated vehicles, from the default gains."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from bench.targets.vehicles import noise_free_error, population
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only


def two_flights(tmp_path: Path, vehicle: str, seed: int) -> list[dict[str, Any]]:
    out = tmp_path / "campaign.json"
    named = ("--strategy", "calibrated", "--vehicle", vehicle, "--seed", str(seed))
    budget = ("--set", "stop=budget", "--max-flights", "2")
    result = CliRunner().invoke(app, ["run", "ardrone-takeoff", *named, *budget, "--json", str(out)])
    assert result.exit_code == 0, result.output
    trials: list[dict[str, Any]] = json.loads(out.read_text())["trials"]
    return trials


@pytest.mark.complete
def test_the_second_flight_of_the_simulated_ardrone_is_at_its_optimum(tmp_path: Path) -> None:
    """At most 0.0945 m; the best gains that are known fly 0.0919 m, the paper's seventh flight scored 0.0940 m."""
    first, second = two_flights(tmp_path, "jsbsim", seed=1)
    assert first["error"] == pytest.approx(0.3267, abs=0.003)
    assert second["error"] <= 0.0945


@pytest.mark.parametrize("seed", [11, *(pytest.param(seed, marks=pytest.mark.complete) for seed in (12, 13))])
def test_the_second_flight_of_the_twin_has_gains_within_5_percent_of_its_optimum(tmp_path: Path, seed: int) -> None:
    """0.1181 m without scatter, measured once with the original loop."""
    second = two_flights(tmp_path, "twin", seed)[1]
    (twin,) = population("twin", 1, seed)
    assert noise_free_error(twin, second["gains"]) <= 1.05 * 0.1181
    assert second["outcome"] == "valid"
