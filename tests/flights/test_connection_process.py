"""What the process of a session does with its vehicle, flown in lock-step in this one."""

import math
import random
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.autopilots.dialects import PAPARAZZI, Message
from app.common.data_folder import telemetry_log
from app.common.states import ActKind
from app.flights import connection_process as vehicle_process_module
from app.flights.connection_process import VehicleProcess
from app.flights.flight_loop import PipeClosedError, WorkerPipe
from app.flights.process_messages import (
    CancelFlight,
    CommandForwarded,
    ConnectionRequest,
    FlightFailure,
    FlightFinished,
    FlightLanded,
    FlightRequest,
    FromVehicleProcess,
    GainsStaged,
    SafeGainsRestored,
    TakeOffDecision,
    VehicleCommand,
    VehicleRequest,
)
from app.vehicles.base import ConnectionOpened, Identity, LinkedVehicle
from app.vehicles.flight_end import StopRequest
from app.vehicles.kinds import Options
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mavlink_kind import MAVLINK
from bench.hazards.hostile_links import MessageForger
from tests.vehicles.flying import SAFE, TUNED
from tests.vehicles.mavlink.rigs import LockstepRig
from tests.vehicles.mavlink.test_connected import START_ENGINE, TAKE_OFF


class AnsweringRig(LockstepRig):
    """Calls `on_heard` with whatever is sent to the drone, which hears nothing before `deaf_until_s`."""

    on_heard: Callable[[Message], None] = staticmethod(lambda _message: None)
    deaf_until_s = 0.0

    def write(self, data: bytes) -> bool:
        seen = len(self.heard)
        if self.drone.time_s < self.deaf_until_s:
            self.heard += [(self.drone.time_s, message) for message in self._codec.parse(data)]
            taken = True
        else:
            taken = super().write(data)
        for _, message in self.heard[seen:]:
            self.on_heard(message)
        return taken


class RecordingPipe(WorkerPipe):
    """The process's end of the pipe, and everything that it said but how the vehicle is."""

    def __init__(self) -> None:
        self.workers_end, theirs = Pipe()
        super().__init__(theirs)
        self.said: list[FromVehicleProcess] = []
        self.on_staged: Callable[[], object] = lambda: None

    def send(self, message: FromVehicleProcess) -> None:
        self.said.append(message)
        if isinstance(message, GainsStaged):
            self.on_staged()

    def send_if_ready(self, message: FromVehicleProcess) -> None: ...


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Iterator[AnsweringRig]:
    with AnsweringRig() as one:
        take_the_place_of_every_vehicle(one, monkeypatch)
        yield one


def take_the_place_of_every_vehicle(one: AnsweringRig, monkeypatch: pytest.MonkeyPatch) -> None:
    def connect(
        options: Options,
        safe_gains: Mapping[str, float],
        trial_parameters: Path,
        identity: Identity | None,
        on_wait: Callable[[], None],
        was_flying: bool,
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
            was_flying=was_flying,
            trial_parameters=trial_parameters,
            on_wait=on_wait,
        )

    kind = replace(MAVLINK, connect=connect)
    monkeypatch.setattr(vehicle_process_module, "get_kind", lambda _: kind)


def started(
    rig: AnsweringRig, line: WorkerPipe, folder: Path, safe_gains: Mapping[str, float] = SAFE
) -> VehicleProcess:
    vehicle = LinkedVehicle(
        vehicle_id=1, name="Bench drone", kind="mavlink", options=rig.options(), safe_gains=safe_gains, identity=None
    )
    call = ConnectionRequest(vehicle=vehicle, data_dir=folder, clock=rig)
    return VehicleProcess(line, call)


def flight_of(rig: AnsweringRig, folder: Path) -> FlightRequest:
    telemetry_log(folder, 1).parent.mkdir(exist_ok=True)
    return FlightRequest(
        flight_id=1,
        trial_id=1,
        campaign_id=1,
        experiment="takeoff",
        vehicle_id=1,
        vehicle_kind="mavlink",
        vehicle_options=rig.options(),
        safe_gains=SAFE,
        gains=TUNED,
        seed=1,
    )


@pytest.fixture
def line() -> RecordingPipe:
    return RecordingPipe()


@pytest.fixture
def process(rig: AnsweringRig, line: RecordingPipe, tmp_path: Path) -> VehicleProcess:
    """Connected, with the vehicle on the ground."""
    return started(rig, line, tmp_path)


@pytest.mark.complete
@pytest.mark.parametrize("takes_its_safe_gains", [True, False])
def test_a_vehicle_that_will_not_arm_has_not_flown_whether_or_not_its_safe_gains_can_be_verified(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, tmp_path: Path, takes_its_safe_gains: bool
) -> None:

    def refuse() -> None:
        rig.drone.autopilot.refuses_arming = True
        rig.drone.autopilot.ignores_parameters = not takes_its_safe_gains

    line.on_staged = refuse
    line.workers_end.send(TakeOffDecision(by_s=math.inf))
    process._carry_out(flight_of(rig, tmp_path))
    [trouble] = [said for said in line.said if isinstance(said, FlightFailure)]
    assert ("safe gains" in trouble.what) == (not takes_its_safe_gains)
    assert (trouble.not_flown, trouble.unsafe) == (True, not takes_its_safe_gains)
    assert [type(said) for said in line.said if isinstance(said, SafeGainsRestored | FlightFinished)] == (
        [SafeGainsRestored, FlightFinished] if takes_its_safe_gains else [FlightFinished]
    )


def test_a_take_off_that_comes_too_late_does_not_take_place(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, tmp_path: Path
) -> None:
    """Observed defect: the process was suspended for 20 s, and the vehicle took off unexpectedly afterwards."""
    line.workers_end.send(TakeOffDecision(by_s=time.monotonic() - 0.001))
    process._carry_out(flight_of(rig, tmp_path))
    staged, restored, failure, _ = (said for said in line.said if not isinstance(said, ConnectionOpened))
    assert (staged, restored) == (GainsStaged(dict(TUNED)), SafeGainsRestored(dict(SAFE)))
    assert isinstance(failure, FlightFailure)
    assert (failure.not_flown, failure.unsafe) == (True, False)
    assert "too late" in failure.what
    assert (rig.drone.autopilot.armed, rig.drone.body.stands) == (False, True)
    assert not rig.told("SCRIPT_ITEM"), "no block of its flight plan was asked for"
    assert process._vehicle.read_gains() == SAFE


def test_a_process_that_stands_still_before_it_arms_does_not_take_off(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the last check, after its takeoff command came in time."""
    stood_still_s = 0.0
    clock = SimpleNamespace(monotonic=lambda: time.monotonic() + stood_still_s)
    monkeypatch.setattr(vehicle_process_module, "time", clock)

    def stand_still(message: Message) -> None:
        nonlocal stood_still_s
        if message.get_type() == "PARAM_REQUEST_READ":
            stood_still_s = 20.0

    def watch() -> None:
        rig.on_heard = stand_still

    line.on_staged = watch
    line.workers_end.send(TakeOffDecision(by_s=time.monotonic() + 3600.0))
    process._carry_out(flight_of(rig, tmp_path))
    [failure] = [said for said in line.said if isinstance(said, FlightFailure)]
    assert (failure.not_flown, failure.unsafe, "too late" in failure.what) == (True, False, True)
    assert SafeGainsRestored(dict(SAFE)) in line.said
    assert (rig.drone.autopilot.armed, rig.drone.body.stands) == (False, True)


def test_safe_gains_that_a_person_changes_in_the_first_session_are_written(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess
) -> None:
    assert line.said == [ConnectionOpened(identity=process._vehicle.identity, concern="", held=dict(SAFE))]
    answered = process._act(VehicleRequest(kind=ActKind.RESTORE, safe_gains=TUNED))
    assert (answered.problem, answered.concern, answered.held) == ("", "", dict(TUNED))
    process._vehicle._observe("Somebody else armed it.")  # type: ignore[attr-defined]
    answered = process._act(VehicleRequest(kind=ActKind.RESTORE, safe_gains=SAFE))
    assert (answered.problem, answered.concern, answered.held) == ("", "Somebody else armed it.", dict(SAFE))


def test_changed_safe_gains_that_a_vehicle_does_not_take_leave_it_observed(
    rig: AnsweringRig, process: VehicleProcess
) -> None:
    rig.drone.autopilot.ignores_parameters = True
    answered = process._act(VehicleRequest(kind=ActKind.CHECK, safe_gains=TUNED))
    assert "Its safe gains could not be verified" in answered.concern
    rig.drone.autopilot.ignores_parameters = False
    answered = process._act(VehicleRequest(kind=ActKind.RELEASE, safe_gains=TUNED))
    assert (answered.problem, answered.concern, answered.held) == ("", "", dict(TUNED))


def test_a_vehicle_that_holds_what_nobody_decided_about_keeps_it_whatever_its_safe_gains_become(
    rig: AnsweringRig, tmp_path: Path
) -> None:
    """Its owner's gains, met for the first time, and a slip of the hand in the safe gains named for it."""
    process = started(rig, RecordingPipe(), tmp_path, safe_gains=TUNED)
    assert "nothing was written" in process._vehicle.concern
    other = {**TUNED, "kp": TUNED["kp"] + 1}
    answered = process._act(VehicleRequest(kind=ActKind.CHECK, safe_gains=other))
    assert "nothing was written" in answered.concern
    answered = process._act(VehicleRequest(kind=ActKind.CHECK, safe_gains=SAFE))
    assert (answered.concern, answered.held) == ("", dict(SAFE))


MOTORS_OFF = VehicleCommand(7, "motors off", "people below", math.inf)
LAND = VehicleCommand(8, "land", "it drifts", math.inf)


def order_when(
    rig: AnsweringRig, line: RecordingPipe, kind: str, *ordered: VehicleCommand, nth: int = 1
) -> list[float]:
    """Give orders as the drone hears the n-th message of that kind from now on; the vehicle's time of that."""
    heard: list[str] = []
    ordered_s: list[float] = []

    def on_heard(message: Message) -> None:
        heard.append(message.get_type())
        if message.get_type() == kind and heard.count(kind) == nth:
            ordered_s.append(rig.now_s())
            for each in ordered:
                line.workers_end.send(each)

    rig.on_heard = on_heard
    return ordered_s


def stops_told_s(rig: AnsweringRig) -> list[float]:
    return [at_s for at_s, message in rig.heard if message.get_type() == "COMMAND_LONG"]


@pytest.mark.parametrize(
    ("kind", "while_it_hears"),
    [
        (ActKind.CHECK, "PARAM_REQUEST_READ"),
        (ActKind.PARAMETERS, "PARAM_REQUEST_LIST"),
        (ActKind.RESTORE, "PARAM_SET"),
        (ActKind.RELEASE, "PARAM_SET"),
    ],
)
def test_a_command_is_executed_at_once_and_ends_the_act_in_progress(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, kind: ActKind, while_it_hears: str
) -> None:
    ordered_s, told = order_when(rig, line, while_it_hears, MOTORS_OFF), len(stops_told_s(rig))
    answered = process._act(VehicleRequest(kind=kind, safe_gains=SAFE))
    assert "interrupted: motors off was commanded (people below)" in answered.problem
    assert line.said[-1] == CommandForwarded(MOTORS_OFF, is_awaited=True)
    assert stops_told_s(rig)[told] - ordered_s[0] < 0.5


@pytest.mark.parametrize("ordered", [MOTORS_OFF, LAND], ids=["motors off", "land"])
def test_an_order_is_carried_out_at_once_while_changed_safe_gains_are_written(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, ordered: VehicleCommand
) -> None:
    ordered_s = order_when(rig, line, "PARAM_SET", ordered)
    told = len(rig.heard)
    answered = process._act(VehicleRequest(kind=ActKind.CHECK, safe_gains=TUNED))
    forwarded = CommandForwarded(ordered, is_awaited=ordered is MOTORS_OFF)
    assert forwarded in line.said
    kind = "COMMAND_LONG" if ordered is MOTORS_OFF else "SCRIPT_ITEM"
    assert next(at_s for at_s, message in rig.heard[told:] if message.get_type() == kind) - ordered_s[0] < 0.5
    assert (answered.problem, answered.held) == ("", dict(TUNED))


def test_an_order_that_comes_too_late_is_not_passed_on_and_interrupts_nothing(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess
) -> None:
    order_when(rig, line, "PARAM_SET", replace(MOTORS_OFF, by_s=time.monotonic() - 0.001))
    told = len(stops_told_s(rig))
    assert process._act(VehicleRequest(kind=ActKind.RESTORE, safe_gains=SAFE)).problem == ""
    said = line.said[-1]
    assert isinstance(said, CommandForwarded)
    assert (said.command.number, "too late" in said.problem) == (7, True)
    assert len(stops_told_s(rig)) == told


def test_orders_while_the_gains_of_a_flight_are_written_end_it_on_the_ground_with_its_safe_gains(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, tmp_path: Path
) -> None:
    """Land, and motors off at once after it, which comes while the safe gains are given back; what waits before them in
    the pipe is kept."""
    line.workers_end.send(CancelFlight(9, StopRequest("of another flight")))
    line.on_staged = lambda: line.workers_end.send(TakeOffDecision(None))
    order_when(rig, line, "PARAM_SET", LAND, MOTORS_OFF, nth=2)
    process._carry_out(flight_of(rig, tmp_path))
    answers = [said for said in line.said if isinstance(said, CommandForwarded)]
    assert [(said.command.order, said.problem, said.is_awaited) for said in answers[:2]] == [
        ("land", "", False),
        ("motors off", "", True),
    ]
    [failure] = [said for said in line.said if isinstance(said, FlightFailure)]
    assert ("interrupted: land was commanded (it drifts)" in failure.what, failure.unsafe) == (True, False)
    assert SafeGainsRestored(dict(SAFE)) in line.said
    assert not any(isinstance(said, GainsStaged) for said in line.said)
    assert line.receive() == CancelFlight(9, StopRequest("of another flight"))
    assert process._vehicle.read_gains() == SAFE


def test_an_order_between_the_take_off_and_arming_keeps_the_vehicle_on_the_ground(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, tmp_path: Path
) -> None:
    line.workers_end.send(TakeOffDecision(by_s=math.inf))
    line.on_staged = partial(order_when, rig, line, "PARAM_REQUEST_READ", LAND)
    process._carry_out(flight_of(rig, tmp_path))
    [failure] = [said for said in line.said if isinstance(said, FlightFailure)]
    assert ("land was commanded" in failure.what, failure.not_flown, failure.unsafe) == (True, True, False)
    assert (rig.drone.autopilot.armed, rig.drone.body.stands) == (False, True)
    assert process._vehicle.read_gains() == SAFE


@pytest.mark.complete
def test_motors_off_while_the_safe_gains_are_written_after_a_flight_is_carried_out_and_they_are_verified(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, tmp_path: Path
) -> None:
    line.workers_end.send(TakeOffDecision(by_s=math.inf))
    line.on_staged = partial(order_when, rig, line, "PARAM_SET", MOTORS_OFF, nth=2)
    process._carry_out(flight_of(rig, tmp_path))
    assert stop_outcomes(process, line) == [""]
    assert not any(isinstance(said, FlightFailure) for said in line.said)
    assert any(isinstance(said, FlightLanded) for said in line.said)
    assert SafeGainsRestored(dict(SAFE)) in line.said
    assert process._vehicle.concern == ""


def stop_outcomes(process: VehicleProcess, line: RecordingPipe) -> list[str]:
    """The problems of the commands to stop the motors, seven seconds later, when all are known."""
    for _ in range(7):
        process._vehicle.attend(1.0)
        process._publish_status()
    said = [each for each in line.said if isinstance(each, CommandForwarded) and each.command.order == "motors off"]
    assert len([each for each in said if each.is_awaited]) == len(said) / 2
    return [each.problem for each in said if not each.is_awaited]


@pytest.mark.complete
@pytest.mark.parametrize("is_confirmed", [True, False])
@pytest.mark.parametrize("in_flight", [True, False])
def test_motors_off_is_done_only_once_the_vehicle_has_confirmed_it(
    rig: AnsweringRig,
    line: RecordingPipe,
    process: VehicleProcess,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    is_confirmed: bool,
    in_flight: bool,
) -> None:
    """Seen: it was recorded as done though the vehicle had never confirmed it, and the vehicle was ready."""

    def fall_silent(message: Message) -> None:
        rig.muted = rig.muted or (message.get_type() == "COMMAND_LONG" and not is_confirmed)

    rig.on_heard = fall_silent
    if in_flight:
        ordered, receive = [MOTORS_OFF], line.receive
        line.workers_end.send(TakeOffDecision(by_s=math.inf))
        monkeypatch.setattr(
            line, "receive", lambda: ordered.pop() if ordered and rig.drone.body.altitude_m > 1.0 else receive()
        )
        process._carry_out(flight_of(rig, tmp_path))
    else:
        process._forward_command(MOTORS_OFF)
    problem = "" if is_confirmed else "The vehicle has not confirmed that its motors stopped."
    assert stop_outcomes(process, line) == [problem]
    assert (process._vehicle.concern == "") == (is_confirmed and not in_flight)


def in_the_air(rig: AnsweringRig, process: VehicleProcess) -> None:
    """As somebody else has it take off, once its plan has set its ground reference."""
    process._vehicle.attend(12.0)
    for block in (START_ENGINE, TAKE_OFF):
        rig.drone.autopilot._enter(block)  # type: ignore[attr-defined]
        process._vehicle.attend(1.0)
    while rig.drone.body.altitude_m < 2.0:
        process._vehicle.attend(0.1)


def left_alone(process: VehicleProcess, line: RecordingPipe, rig: AnsweringRig, *ordered: VehicleCommand) -> float:
    """Give orders, and let the worker die; for how long the process went on."""
    for each in ordered:
        line.workers_end.send(each)
    line.workers_end.close()
    begun_s = rig.now_s()
    with pytest.raises(PipeClosedError):
        process.run()
    return rig.now_s() - begun_s


@pytest.mark.complete
def test_land_is_repeated_after_the_worker_died_until_the_vehicle_responds(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess
) -> None:
    in_the_air(rig, process)
    rig.deaf_until_s = rig.now_s() + 5.0
    assert 5.0 < left_alone(process, line, rig, LAND) < 60.0
    assert rig.drone.body.stands


@pytest.mark.complete
@pytest.mark.parametrize("silenced", [{"deaf_until_s": math.inf}, {"muted": True}], ids=["never obeys", "falls silent"])
def test_a_vehicle_in_the_air_that_does_not_respond_gets_the_command_for_a_minute(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, silenced: dict[str, float | bool]
) -> None:
    in_the_air(rig, process)
    for name, value in silenced.items():
        setattr(rig, name, value)
    assert left_alone(process, line, rig, LAND) == pytest.approx(60.0, abs=0.1)


@pytest.mark.complete
def test_a_vehicle_that_got_land_unheard_for_a_minute_keeps_no_process_waiting(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess
) -> None:
    """Seen: two drones were gone, and the server took a minute to stop."""
    in_the_air(rig, process)
    process._vehicle.land("the link was lost")
    rig.muted = True
    process._vehicle.attend(60.5)
    assert left_alone(process, line, rig) < 0.1


@pytest.mark.complete
def test_one_heartbeat_that_reports_it_disarmed_does_not_end_land_after_the_worker_died(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seen: the process exited after 2.2 s, and the drone hovered on at 2.7 m."""
    in_the_air(rig, process)
    rig.deaf_until_s = math.inf
    forger = MessageForger("paparazzi", PAPARAZZI, rig.drone, random.Random(1))
    once = [forger.heartbeat(forger.codec(forger.own, 200), armed=False, mode=(4, 0))]
    since_s = rig.now_s()

    def arriving(frames: list[bytes]) -> list[bytes]:
        return [*frames, once.pop()] if once and rig.now_s() - since_s > 2.2 else frames

    monkeypatch.setattr(rig, "arriving", arriving)
    assert left_alone(process, line, rig, LAND) == pytest.approx(60.0, abs=0.1)
    assert not once


@pytest.mark.parametrize("ordered", [(), (LAND,), (MOTORS_OFF,)], ids=["nothing", "land", "motors off"])
def test_a_vehicle_on_the_ground_keeps_no_process_waiting(
    rig: AnsweringRig, line: RecordingPipe, process: VehicleProcess, ordered: tuple[VehicleCommand, ...]
) -> None:
    assert left_alone(process, line, rig, *ordered) < 0.1
