"""`gainline run` and `gainline reproduce`: the real commands on real simulations.

Expected errors are bounds: of the project's reference measurement and of the paper's best flights (Tables 1 and 2).
"""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from app.campaigns.campaign_files import preset_names
from app.campaigns.trials import records
from app.cli.commands import app
from app.core.experiments.base import Experiment
from app.core.policy import Gains
from app.core.records.glitches import Glitch
from app.core.records.trajectory import Trajectory
from app.vehicles.simulated import StagedVehicle

RUN_ON_TWIN = ("run", "ardrone-takeoff", "--vehicle", "twin", "--set", "scatter=0")


def gainline(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def flown(tmp_path: Path, *arguments: str) -> dict[str, Any]:
    out = tmp_path / "campaign.json"
    result = gainline(*arguments, "--json", out)
    assert result.exit_code == 0, result.output
    document: dict[str, Any] = json.loads(out.read_text())
    return document


def errors(campaign: dict[str, Any]) -> list[float]:
    return [trial["error"] for trial in campaign["trials"]]


@pytest.mark.complete
def test_the_same_seed_gives_the_same_campaign_and_another_seed_another(tmp_path: Path) -> None:
    noisy = ("run", "ardrone-takeoff", "--vehicle", "twin", "--max-flights", "3")
    first, again, other = (flown(tmp_path, *noisy, "--seed", seed) for seed in ("4", "4", "5"))
    assert first == again
    assert errors(first) != errors(other)


def test_given_gains_start_the_campaign_and_the_budget_ends_it() -> None:
    """Its document is all that standard output gets."""
    result = gainline(*RUN_ON_TWIN, "--start", "286,60,81", "--max-flights", "1", "--json", "-")
    campaign = json.loads(result.stdout)
    assert campaign["trials"][0]["gains"] == {"kp": 286, "ki": 60, "kd": 81}
    assert errors(campaign) == [pytest.approx(0.2341, rel=0.01)]
    assert campaign["stopped_because"].startswith("The budget of 1 flight has been flown.")


@pytest.mark.complete
def test_gains_by_hand_are_flown_in_their_order_until_all_are_flown(tmp_path: Path) -> None:
    by_hand = ("--strategy", "manual", "--gains", "283,13,82", "--gains", "kd=81,kp=286,ki=60", "--gains", "283,13,82")
    campaign = flown(tmp_path, *RUN_ON_TWIN, *by_hand)
    assert [tuple(trial["gains"].values()) for trial in campaign["trials"]] == [
        (283, 13, 82),
        (286, 60, 81),
        (283, 13, 82),
    ]
    assert [trial["kind"] for trial in campaign["trials"]] == ["manual", "manual", "repeat"]
    assert [trial["predicted_error"] for trial in campaign["trials"]] == [None, None, None]
    assert errors(campaign)[1] == pytest.approx(0.2341, rel=0.01)
    assert errors(campaign)[2] == errors(campaign)[0]
    assert campaign["stopped_because"] == "All 3 given gain sets have been flown."


@pytest.mark.complete
def test_the_table_has_a_row_for_each_run(tmp_path: Path) -> None:
    out = tmp_path / "campaign.json"
    result = gainline(*RUN_ON_TWIN, "--max-flights", "2", "--json", out)
    assert result.exit_code == 0
    first, second = (line.split()[:5] for line in result.stdout.splitlines() if re.match(r" flight \d", line))
    assert first == ["flight", "1", "0.5235", "–", "283"], "an interval down to zero predicts nothing"
    assert float(second[3]) > 0.0
    earlier, later = json.loads(out.read_text())["trials"]
    assert (earlier["number"], earlier["predicted_error"], earlier["predicted_interval"]) == (1, None, None)
    assert later["predicted_interval"]["lower"] < later["predicted_error"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--vehicle", "import"), "vehicle.kind"),
        (("--set", "wind=3"), "--set wind"),
        (("--set", "wind_m_s"), "--set wind_m_s"),
        (("--set", f"wind_m_s={'9' * 400}"), "vehicle.options.wind_m_s"),
        (("--strategy", "gradient", "--set", "scaled=maybe"), "definition.options.scaled"),
        (("--start", "1,2"), "--start"),
        (("--start", "nan,13,82"), "definition.start.gains.kp"),
        (("--gains", "283,13,82"), "gains"),
        (("--strategy", "manual", "--gains", "283,13"), "--gains"),
        (("--strategy", "manual", "--gains", "kp=283,ki=13,82"), "--gains"),
        (("--strategy", "manual", "--gains", "kp=283,ki=13,kx=82"), "gains.0.kd"),
        (("--strategy", "manual", "--gains", "283,13,82", "--gains", "283,13,500"), "gains.1.kd"),
        (("--json", "/nowhere/out.json", "--max-flights", "1"), "--json"),
    ],
)
def test_what_cannot_be_flown_is_refused_by_name(arguments: tuple[str, ...], named: str) -> None:
    result = gainline("run", "ardrone-takeoff", *arguments)
    assert result.exit_code == 1
    assert f"  {named}: " in result.stderr


@pytest.mark.parametrize("given", [("--set", "wind_m_s=.inf"), ("--set", "step_fraction=.inf")])
def test_a_non_finite_number_is_quoted_in_the_error(given: tuple[str, str]) -> None:
    result = gainline("run", "ardrone-takeoff", *given)
    assert result.exit_code == 1
    assert "got inf" in result.stderr


def test_an_unknown_preset_names_those_there_are() -> None:
    result = gainline("run", "ardrone-landing")
    assert result.exit_code == 1
    assert all(name in result.stderr for name in preset_names())


@pytest.mark.complete
def test_a_refused_start_flies_with_a_reason_that_the_result_keeps(tmp_path: Path) -> None:
    """Hardly any damping: the takeoffs that the gate simulates swing more and more."""
    undamped = ("run", "ardrone-takeoff", "--start", "1500,1000,40", "--max-flights", "1")
    refused = gainline(*undamped)
    assert refused.exit_code == 1
    assert "The gate refuses these gains." in refused.output
    assert "aborted at" in refused.output
    campaign = flown(tmp_path, *undamped, "--overrule", "to see it swing")
    assert [trial["overrule_reason"] for trial in campaign["trials"]] == ["to see it swing"]
    assert errors(campaign)[0] > 0.3


def test_gains_that_the_vehicle_does_not_hold_are_not_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    staged, asked = StagedVehicle.stage, list[Gains]()

    def forget_once(vehicle: StagedVehicle, gains: Gains) -> dict[str, float]:
        asked.append(gains)
        return staged(vehicle, gains) | ({"kp": 1.0} if len(asked) == 1 else {})

    monkeypatch.setattr(StagedVehicle, "stage", forget_once)
    result = gainline(*RUN_ON_TWIN, "--max-flights", "1")
    assert result.exit_code == 1
    said = "Flight 1: The vehicle did not accept the gains: kp is 1 instead of 283. It was not flown."
    assert said in " ".join(result.stderr.split())
    assert len(asked) == 2, "the safe gains are restored"


SPIKE = Glitch(kind="acceleration", start_s=1.0, end_s=1.1, sentence="The altitude jumps.")


@pytest.mark.complete
def test_flights_with_a_glitch_do_not_count_and_a_low_battery_ends_their_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The twin's battery holds 11.1 V; every record has a glitch, and there is nobody to look at it."""

    def always_one(_experiment: Experiment, _record: Trajectory) -> tuple[Glitch, ...]:
        return (SPIKE,)

    monkeypatch.setattr(records, "find_glitches", always_one)
    monkeypatch.setattr(records, "repaired", lambda _experiment, record, _glitches: record)
    file = tmp_path / "low.yaml"
    file.write_text(
        "name: Low battery\nvehicle: {kind: twin}\ndefinition: {stop: {kind: budget, max_flights: 3, "
        "min_battery_v: 11.5}}\n"
    )
    campaign = flown(tmp_path, "run", str(file))
    assert [(trial["outcome"], trial["reason"], trial["error"]) for trial in campaign["trials"]] == [
        ("invalid", "The altitude jumps.", None)
    ]
    assert campaign["best"] is None
    assert campaign["stopped_because"].startswith("The last flight ended at 11.10 V; the minimum is 11.5 V.")


@pytest.mark.complete
def test_flights_that_cannot_count_end_with_the_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(records, "find_glitches", lambda _experiment, _record: (SPIKE,))
    monkeypatch.setattr(records, "repaired", lambda _experiment, record, _glitches: record)
    campaign = flown(tmp_path, *RUN_ON_TWIN, "--max-flights", "2")
    assert [trial["outcome"] for trial in campaign["trials"]] == ["invalid"] * 2
    assert campaign["stopped_because"] == "All 2 flights have been flown; 2 of them could not be scored."


@pytest.mark.complete
def test_a_strategy_without_a_further_step_is_said_to_propose_none(tmp_path: Path) -> None:
    named = ("--strategy", "simplex", "--set", "stop=budget", "--max-flights", "3")
    campaign = flown(tmp_path, *RUN_ON_TWIN, *named)
    assert [trial["kind"] for trial in campaign["trials"]] == ["start", "step", "none"]
