"""docs/api.md agrees with the API, and its scripts run as printed."""

import re
import subprocess
import sys
from enum import StrEnum
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from app.autopilots.registry import get_experiment
from app.campaigns.schemas import Definition, Sort
from app.common.states import CampaignState, JobState, Outcome, TrialState, VehicleState
from app.core.records.trajectory import CHANNEL_UNITS
from app.vehicles.simulated import simulate_flight, trajectory_of
from app.vehicles.twin import TWIN, TwinFlight
from app.web.errors import _KINDS
from tests.runtime.processes import Serving, environment

DOCUMENT = Path(__file__).parents[2] / "docs" / "api.md"
TEXT = DOCUMENT.read_text()
OPTIMUM_M = 0.1180
"""Lowest error of the twin without scatter, which the test after the scripts' finds again."""
SCRIPTS = re.findall(r"^```python\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)


@pytest.mark.complete
def test_the_scripts_reach_the_twins_optimum_with_the_second_flight_against_a_real_server(tmp_path: Path) -> None:
    """Neither vehicle scatters: the first script's own drone is the model of the twin that the second one flies."""
    assert len(SCRIPTS) == 2
    with Serving(tmp_path / "data") as server:
        printed = []
        for number, script in enumerate(SCRIPTS):
            file = tmp_path / f"script{number}.py"
            file.write_text(script)
            done = subprocess.run(
                [sys.executable, str(file), server.url], env=environment(), text=True, capture_output=True, check=False
            )
            assert done.returncode == 0, done.stderr
            printed.append(done.stdout.splitlines())
        flights = [server.get(f"/campaigns/{campaign}/trials")["items"] for campaign in (1, 2)]
    asked_and_told, flown = printed
    assert re.fullmatch(r"best: trial \d, \d\.\d{4} m", asked_and_told[-1])
    assert asked_and_told[-2].startswith("finished: Better with ")
    assert [line.split()[0] for line in flown] == ["1", "2"]
    for trials in flights:
        assert trials[0]["error"] > 4.0 * OPTIMUM_M
        assert trials[1]["error"] <= 1.02 * OPTIMUM_M


@pytest.mark.complete
def test_the_twins_optimum_is_the_lowest_error_of_its_bounded_gains_without_scatter() -> None:
    """By differential evolution (Storn and Price, 1997), which knows nothing of how the strategies search."""
    takeoff, options = get_experiment("takeoff"), {option.name: float(option.default) for option in TWIN.options}

    def flown(counts: NDArray[np.float64]) -> float:
        gains = dict(zip(takeoff.space.names, counts.tolist(), strict=True))
        rows = simulate_flight(TwinFlight({**options, "scatter": 0.0}, 0), gains)
        return takeoff.error(trajectory_of(rows, "twin"))

    found = differential_evolution(
        flown,
        Bounds(takeoff.space.lower, takeoff.space.upper),
        integrality=[True] * 3,
        popsize=12,
        maxiter=60,
        tol=1e-6,
        polish=False,
        rng=2,
    )
    assert found.fun == pytest.approx(OPTIMUM_M, rel=0.002)


def test_every_call_is_in_the_document(client: TestClient) -> None:
    paths = client.get("/api/openapi.json").json()["paths"]
    calls = {f"`{method.upper()} {path}`" for path, operations in paths.items() for method in operations}
    assert {call for call in calls if call not in TEXT} == set()
    written = set(re.findall(r"`(?:GET|POST|PATCH|DELETE) /api[^`]*`", TEXT)) - {"`GET /api/health)`"}
    assert written - calls == set()


def test_every_kind_of_error_is_in_the_document_with_its_status_and_title() -> None:
    rows = {line.strip() for line in TEXT.splitlines() if line.lstrip().startswith("| ")}
    for status, title in _KINDS.values():
        name = title.lower().replace(" ", "-")
        assert any(row.startswith(f"| {status.value} | `{name}` | {title} |") for row in rows), title


def test_every_field_of_a_definition_is_in_the_document() -> None:
    assert {field for field in Definition.model_fields if f"| `{field}` |" not in TEXT} == set()


@pytest.mark.parametrize("states", [CampaignState, Outcome, TrialState, JobState, VehicleState, Sort])
def test_every_state_is_in_the_document(states: type[StrEnum]) -> None:
    assert {state.value for state in states if f"`{state.value}`" not in TEXT} == set()


def test_every_channel_is_in_the_document() -> None:
    assert {name for name in ("time_s", *CHANNEL_UNITS) if f"`{name}`" not in TEXT} == set()
