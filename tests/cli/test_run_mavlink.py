"""`gainline run` on a simulated drone at the other end of a link."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from app.cli.commands import app
from app.vehicles.base import FlightOptions, FlightRecord, SafeGainsError, VehicleError
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from tests.vehicles.mavlink.rigs import SAFE, LockstepRig

VEHICLE = "mavlink:udp:127.0.0.1:4245@4244"
RUN = ("run", "ardrone-takeoff", "--strategy", "gradient", "--max-flights", "3")


@pytest.fixture(autouse=True)
def _data_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GAINLINE_DATA_DIR", str(tmp_path / "data"))


def gainline(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.mark.complete
def test_a_whole_campaign_is_flown_over_the_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, logs = tmp_path / "campaign.json", tmp_path / "logs"
    logs.mkdir()
    rig = LockstepRig()
    rig.take_the_place_of_every_vehicle(monkeypatch)
    result = gainline(
        *RUN, "--vehicle", VEHICLE, "--set", "simulated=true", "--set", f"log_folder={logs}", "--json", str(out)
    )
    assert result.exit_code == 0, result.output
    written = [name for name in rig.writes if name.startswith("gui_v_")]
    trials = json.loads(out.read_text())["trials"]
    assert [trial["outcome"] for trial in trials] == ["valid"] * 3, [trial["reason"] for trial in trials]
    assert trials[0]["gains"] == dict(SAFE["paparazzi"])
    assert min(trial["error"] for trial in trials[1:]) < 0.6 * trials[0]["error"]
    assert written[-3:] == ["gui_v_kp", "gui_v_ki", "gui_v_kd"]
    assert len(list(logs.glob("*.tlog"))) == 3


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--vehicle", "mavlink:udp:127.0.0.1:4245@4244"), "vehicle.kind: mavlink is not a simulation"),
        (("--vehicle", "mavlink:udp:10.0.0.2:4245@4244"), "vehicle.kind: mavlink is not a simulation"),
        (
            ("--vehicle", "mavlink:udp:10.0.0.2:4245@4244", "--set", "simulated=true"),
            "vehicle.options.simulated: must be off for udp:10.0.0.2:4245@4244",
        ),
        (("--vehicle", "mavlink:here"), "vehicle.options.address: must be udp:HOST:PORT"),
        (("--vehicle", "twin:udp:127.0.0.1:4245"), "vehicle.options.address: is not an option of twin"),
    ],
)
def test_a_real_vehicle_is_refused_before_anything_is_opened(arguments: tuple[str, ...], said: str) -> None:
    result = gainline(*RUN, *arguments)
    assert result.exit_code == 1
    assert said in " ".join(result.output.split())


@pytest.mark.complete
def test_a_campaign_that_an_error_ends_prints_the_flights_it_has_and_which_gains_the_vehicle_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "campaign.json"
    rig = LockstepRig()
    rig.take_the_place_of_every_vehicle(monkeypatch)
    flown = MavlinkVehicle.fly
    flights: list[int] = []

    def fly_once(vehicle: MavlinkVehicle, order: FlightOptions, **watched: Any) -> FlightRecord:
        flights.append(1)
        if len(flights) > 1:
            raise VehicleError("The battery is below 10.2 V.", hint="Charge it.")
        return flown(vehicle, order, **watched)

    monkeypatch.setattr(MavlinkVehicle, "fly", fly_once)
    result = gainline(*RUN, "--vehicle", VEHICLE, "--set", "simulated=true", "--json", str(out))
    assert result.exit_code == 1
    printed = " ".join(result.output.split())
    assert "flight 1" in printed
    assert "Stopped: an error occurred: The battery is below 10.2 V." in printed
    assert "The safe gains are restored and read back: kp 283, ki 13, kd 82." in printed
    document = json.loads(out.read_text())
    assert [trial["outcome"] for trial in document["trials"]] == ["valid"]
    assert document["stopped_because"].startswith("an error occurred")


@pytest.mark.complete
def test_when_the_safe_gains_could_not_be_verified_it_says_that_nobody_knows_what_the_vehicle_holds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = LockstepRig()
    rig.take_the_place_of_every_vehicle(monkeypatch)

    def forget(_vehicle: MavlinkVehicle, _order: FlightOptions, **_watched: Any) -> FlightRecord:
        raise SafeGainsError("The vehicle does not answer.", hint="Look at it.")

    monkeypatch.setattr(MavlinkVehicle, "fly", forget)
    result = gainline(*RUN, "--vehicle", VEHICLE, "--set", "simulated=true")
    assert result.exit_code == 1
    assert "The gains on the vehicle are unknown" in " ".join(result.output.split())
