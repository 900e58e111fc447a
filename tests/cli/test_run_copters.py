"""Three trials by hand on each copter; on one of them between processes, in real time, over a real link."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, Final

import pytest
from typer.testing import CliRunner

from app.autopilots.dialects import number, text
from app.autopilots.px4.simulated import Px4
from app.autopilots.registry import AUTOPILOTS
from app.autopilots.simulated.copter_parameters import Parameters
from app.campaigns.campaign_files import read_preset
from app.cli.commands import app
from app.core.clock import ScaledClock
from app.vehicles.base import Identity
from app.vehicles.mavlink.addresses import Address, parse
from app.vehicles.mavlink.link import Link
from tests.ports import free_port
from tests.vehicles.mavlink.rigs import LockstepRig
from tests.vehicles.mavlink.speaking import LOOPBACK
from tests.waiting import wait_for

GAINLINE = Path(sys.executable).parent / "gainline"
SPEED: Final = 2
"""Of the drone's time. The ground's is that of life, so that a busy machine does not make time-outs pass."""
HELD: Final[Mapping[str, Mapping[str, float]]] = {
    "ardupilot": {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 1.0, "PSC_ACCZ_D": 0.0},
    "ardupilot-4.7": {"PSC_D_POS_P": 1.0, "PSC_D_VEL_P": 5.0, "PSC_D_ACC_P": 0.05, "PSC_D_ACC_I": 0.1},
    "px4": {"MPC_Z_P": 1.0, "MPC_Z_VEL_P_ACC": 4.0, "MPC_Z_VEL_I_ACC": 2.0, "MPC_Z_VEL_D_ACC": 0.0},
}
"""By the vehicle's own names."""
SETS: Final = {
    "ardupilot": ("1,5,0.5,1,0", "1.5,5,0.5,1,0", "1.5,6,0.4,0.8,0"),
    "px4": ("1,4,2,0", "1.2,4,2,0", "1.2,6,1.5,0"),
}


def by_hand(profile: str, count: int = 3) -> list[str]:
    sets = [argument for gains in SETS[profile][:count] for argument in ("--gains", gains)]
    return ["run", f"{profile}-altitude-steps", "--strategy", "manual", *sets]


def said(stream: IO[str] | None, words: str) -> None:
    assert stream is not None
    for line in stream:
        if words in line:
            return
    raise AssertionError(f"it ended before it said {words!r}")


@contextmanager
def drone(autopilot: str) -> Iterator[str]:
    """A simulated one; gives the address at which a ground station reaches it."""
    address = Address("udp", LOOPBACK, free_port(), free_port())
    link = f"udp:{LOOPBACK}:{address.local_port}@{address.number}"
    body = ("--vehicle", "twin", "--speed", str(SPEED))
    command = [str(GAINLINE), "sim-drone", "--autopilot", autopilot, "--link", link, *body]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
    ) as process:
        try:
            said(process.stdout, f"Simulated time runs at {SPEED} times real time")
            yield str(address)
        finally:
            process.send_signal(signal.SIGTERM)


def held_by(address: str, profile: str, names: Mapping[str, float]) -> dict[str, float]:
    """What the vehicle says it holds, asked as any ground station asks."""
    found: dict[str, float] = {}
    with closing(Link(parse(address), AUTOPILOTS[profile].dialect, clock=ScaledClock(1.0))) as link:

        def ask() -> None:
            for name in names.keys() - found.keys():
                whom = {"target_system": 1, "target_component": 1}
                link.send("PARAM_REQUEST_READ", **whom, param_id=name, param_index=-1)
            for received in link.receive(0.2):
                message = received.message
                if message.get_type() == "PARAM_VALUE" and text(message, "param_id") in names:
                    found[text(message, "param_id")] = number(message, "param_value")

        wait_for("all that it holds", lambda: len(found) == len(names), ask)
    return found


@pytest.fixture(autouse=True)
def data_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GAINLINE_DATA_DIR", str(tmp_path / "data"))
    return tmp_path / "data"


@pytest.mark.real_time("a drone flies in a process of its own, over real UDP", about_s=30)
@pytest.mark.complete
def test_a_set_is_flown_by_hand_between_processes_in_real_time(tmp_path: Path) -> None:
    out = tmp_path / "campaign.json"
    with drone("ardupilot") as address:
        named = ("--vehicle", f"mavlink:{address}", "--json", out)
        result = subprocess.run(
            [GAINLINE, *by_hand("ardupilot", 1), *named], capture_output=True, text=True, check=False
        )
        assert result.returncode == 0, result.stderr
        held = held_by(address, "ardupilot", HELD["ardupilot"])
    assert held == pytest.approx(HELD["ardupilot"])
    see_sets_flown("ardupilot", 1, out, result.stdout)


class FatalClimb(LockstepRig):
    """At 1 m it hands over the drone's parameters, and ends the process that flies it."""

    def __init__(self, parameters: Connection) -> None:
        super().__init__("px4")
        self._parameters = parameters

    def tick(self) -> None:
        super().tick()
        if self.drone.body.altitude_m > 1.0:
            self._parameters.send(px4_of(self).parameters)
            os.kill(os.getpid(), signal.SIGKILL)


def px4_of(rig: LockstepRig) -> Px4:
    assert isinstance(rig.drone.autopilot, Px4)
    return rig.drone.autopilot


def fly_into_death(parameters: Connection) -> None:
    """`gainline run`, in a process of its own."""
    rig = FatalClimb(parameters)
    rig.switch_on_failsafes()
    with pytest.MonkeyPatch.context() as patch:
        rig.take_the_place_of_every_vehicle(patch)
        CliRunner().invoke(app, by_hand("px4", 1))


@pytest.mark.complete
@pytest.mark.parametrize("by", ["gainline run", "the fleet"])
def test_what_a_killed_run_had_set_is_put_back_at_the_next_connection(
    data_dir: Path, by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = data_dir / "trial-parameters"
    ours, theirs = Pipe(duplex=False)
    run = get_context("spawn").Process(target=fly_into_death, args=(theirs,))
    run.start()
    theirs.close()
    held: Parameters = ours.recv()
    run.join()
    assert run.exitcode == -signal.SIGKILL
    assert (held["MIS_TAKEOFF_ALT"], len(list(folder.iterdir()))) == (3.0, 1)

    rig = LockstepRig("px4")  # landed by its own failsafe
    px4_of(rig).parameters = held
    if by == "the fleet":
        pinned = Identity(system_id=1, autopilot="px4", version="1.16.0")
        address = read_preset("px4-altitude-steps").vehicle.options["address"]
        with closing(rig.connected(pinned, folder, address=address)) as vehicle:
            assert vehicle.concern == ""
    else:
        rig.take_the_place_of_every_vehicle(monkeypatch)
        result = CliRunner().invoke(app, [*by_hand("px4"), "--set", "min_battery_v=50"])
        assert result.exit_code == 1, "its battery is too low for another flight"
    assert (held["MIS_TAKEOFF_ALT"], list(folder.iterdir())) == (2.5, [])


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", ["ardupilot-4.7", "px4"])
def test_three_sets_are_flown_by_hand_and_the_safe_gains_are_back(
    tmp_path: Path, autopilot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = autopilot.split("-", maxsplit=1)[0]
    out = tmp_path / "campaign.json"
    rig = LockstepRig(profile, release=autopilot, body={"scatter": 1.0})
    rig.switch_on_failsafes()
    rig.take_the_place_of_every_vehicle(monkeypatch)
    result = CliRunner().invoke(app, [*by_hand(profile), "--json", str(out)])
    assert result.exit_code == 0, result.output
    held = {name: rig.drone.autopilot.parameters[name] for name in HELD[autopilot]}
    assert held == pytest.approx(HELD[autopilot])
    see_sets_flown(profile, 3, out, result.stdout)


def see_sets_flown(profile: str, count: int, out: Path, said: str) -> None:
    trials = json.loads(out.read_text())["trials"]
    assert [trial["outcome"] for trial in trials] == ["valid"] * count, [trial["reason"] for trial in trials]
    assert [",".join(f"{gain:g}" for gain in trial["gains"].values()) for trial in trials] == [*SETS[profile][:count]]
    assert all(0.01 < trial["error"] < 0.6 for trial in trials), [trial["error"] for trial in trials]
    assert [trial["kind"] for trial in trials] == ["manual"] * count
    assert "The safe gains are restored and read back:" in said


def test_gains_that_a_vehicle_is_never_given_are_refused_whoever_overrules(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = LockstepRig("px4")
    rig.switch_on_failsafes()
    rig.take_the_place_of_every_vehicle(monkeypatch)
    written = len(rig.writes)
    gains = "MPC_Z_P=9,MPC_Z_VEL_P_ACC=4,MPC_Z_VEL_I_ACC=2,MPC_Z_VEL_D_ACC=0"
    result = CliRunner().invoke(app, [*by_hand("px4", 0), "--gains", gains, "--overrule", "to see it"])
    assert result.exit_code == 1
    assert "gains.MPC_Z_P: must be between 0.1 and 1.5, got 9" in " ".join(result.stderr.split())
    assert len(rig.writes) == written
