"""What the process of a session does with its vehicle, flown in lock-step in this one."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import pytest

from app.fleet import seat as seat_module
from app.fleet.seat import VehicleProcess, WorkerPipe
from app.fleet.session import ConnectionOpened, ConnectionRequest, FromVehicleProcess, VehicleRequest
from app.fleet.states import ActKind
from app.trials.crew import FlightFailure, FlightFinished, FlightRequest, GainsStaged, SafeGainsRestored, TakeOffCommand
from app.vehicles.base import FlightOptions, Identity
from app.vehicles.kinds import Options
from app.vehicles.mavlink.kind import MAVLINK
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from tests.vehicles.flying import SAFE, TUNED
from tests.vehicles.mavlink.rigs import LockstepRig


class RecordingPipe(WorkerPipe):
    """The process's end of the pipe, and everything that it said but how the vehicle is."""

    def __init__(self) -> None:
        self.workers_end, theirs = Pipe()
        super().__init__(theirs)
        self.said: list[FromVehicleProcess] = []
        self.on_staged: Callable[[], None] = lambda: None

    def send(self, message: FromVehicleProcess) -> None:
        self.said.append(message)
        if isinstance(message, GainsStaged):
            self.on_staged()

    def send_if_ready(self, message: FromVehicleProcess) -> None: ...


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Iterator[LockstepRig]:
    def connect(
        options: Options, safe_gains: Mapping[str, float], identity: Identity | None, trial_parameters: Path
    ) -> MavlinkVehicle:
        return MavlinkVehicle(
            options,
            safe_gains,
            is_real=True,
            clock=one,
            transport=one,
            identity=identity,
            observes=True,
            decided=identity is not None,
            trial_parameters=trial_parameters,
        )

    with LockstepRig() as one:
        kind = replace(MAVLINK, connect=connect)
        monkeypatch.setattr(seat_module, "get_kind", lambda _: kind)
        yield one


def started(rig: LockstepRig, line: WorkerPipe, folder: Path, safe_gains: Mapping[str, float] = SAFE) -> VehicleProcess:
    call = ConnectionRequest(
        vehicle_id=1,
        name="Bench drone",
        kind="mavlink",
        options=rig.options(),
        safe_gains=safe_gains,
        identity=None,
        lock=folder / "vehicle.lock",
        trial_parameters=folder / "parameters.json",
        clock=rig,
    )
    return VehicleProcess(line, call)


def orders(rig: LockstepRig, folder: Path) -> FlightRequest:
    return FlightRequest(
        campaign_id=1,
        trial_id=1,
        experiment="takeoff",
        vehicle_kind="mavlink",
        vehicle_options=rig.options(),
        safe_gains=SAFE,
        gains=TUNED,
        flight=FlightOptions(seed=1),
        lock=folder / "vehicle.lock",
    )


@pytest.mark.parametrize("takes_its_safe_gains", [True, False])
def test_a_vehicle_that_will_not_arm_has_not_flown_whether_or_not_its_safe_gains_can_be_verified(
    rig: LockstepRig, tmp_path: Path, takes_its_safe_gains: bool
) -> None:
    line = RecordingPipe()
    process = started(rig, line, tmp_path)

    def refuse() -> None:
        rig.drone.autopilot.refuses_arming = True
        rig.drone.autopilot.ignores_parameters = not takes_its_safe_gains

    line.on_staged = refuse
    line.workers_end.send(TakeOffCommand(by_s=math.inf))
    process._fly(orders(rig, tmp_path))
    [trouble] = [said for said in line.said if isinstance(said, FlightFailure)]
    assert "would not arm" in trouble.what
    assert ("safe gains" in trouble.what) == (not takes_its_safe_gains)
    assert (trouble.not_flown, trouble.unsafe) == (True, not takes_its_safe_gains)
    assert [type(said) for said in line.said if isinstance(said, SafeGainsRestored | FlightFinished)] == (
        [SafeGainsRestored, FlightFinished] if takes_its_safe_gains else [FlightFinished]
    )


def test_a_take_off_that_comes_too_late_does_not_take_place(rig: LockstepRig, tmp_path: Path) -> None:
    """Seen: the process stood still for 20 s, and the vehicle took off when nobody expected it any more."""
    line = RecordingPipe()
    process = started(rig, line, tmp_path)
    line.workers_end.send(TakeOffCommand(by_s=time.monotonic() - 0.001))
    process._fly(orders(rig, tmp_path))
    staged, restored, failure, _ = (said for said in line.said if not isinstance(said, ConnectionOpened))
    assert (staged, restored) == (GainsStaged(dict(TUNED)), SafeGainsRestored(dict(SAFE)))
    assert isinstance(failure, FlightFailure)
    assert (failure.not_flown, failure.unsafe) == (True, False)
    assert "too late" in failure.what
    assert (rig.drone.autopilot.armed, rig.drone.body.stands) == (False, True)
    assert not rig.told("SCRIPT_ITEM"), "no block of its flight plan was asked for"
    assert process._vehicle.read_gains() == SAFE


def test_safe_gains_that_a_person_changes_in_the_first_session_are_written(rig: LockstepRig, tmp_path: Path) -> None:
    line = RecordingPipe()
    process = started(rig, line, tmp_path)
    assert line.said == [ConnectionOpened(identity=process._vehicle.identity, concern="", held=dict(SAFE))]
    answered = process._act(VehicleRequest(kind=ActKind.RESTORE, safe_gains=TUNED))
    assert (answered.problem, answered.concern, answered.held) == ("", "", dict(TUNED))
    process._vehicle._observe("Somebody else armed it.")  # type: ignore[attr-defined]
    answered = process._act(VehicleRequest(kind=ActKind.RESTORE, safe_gains=SAFE))
    assert (answered.problem, answered.concern, answered.held) == ("", "", dict(SAFE))


def test_a_vehicle_that_holds_what_nobody_decided_about_keeps_it_whatever_its_safe_gains_become(
    rig: LockstepRig, tmp_path: Path
) -> None:
    """Its owner's gains, met for the first time, and a slip of the hand in the safe gains named for it."""
    process = started(rig, RecordingPipe(), tmp_path, safe_gains=TUNED)
    assert "nothing was written" in process._vehicle.concern
    other = {**TUNED, "kp": TUNED["kp"] + 1}
    answered = process._act(VehicleRequest(kind=ActKind.CHECK, safe_gains=other))
    assert "nothing was written" in answered.concern
    answered = process._act(VehicleRequest(kind=ActKind.CHECK, safe_gains=SAFE))
    assert (answered.concern, answered.held) == ("", dict(SAFE))
