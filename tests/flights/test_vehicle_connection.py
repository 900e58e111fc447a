"""The worker's end of a session, with real processes at the other end that behave as the worst vehicle's might."""

import os
import queue
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from app.flights import flight_process as session_module
from app.flights.flight_process import VehicleConnection
from app.flights.process_messages import CommandForwarded, ConnectionRequest, VehicleCommand
from app.live.messages import VehicleStatus
from app.vehicles.base import ConnectionOpened, Identity, LinkedVehicle
from tests.flights.process_ids import pid_of
from tests.waiting import Waits

IDENTITY = Identity(system_id=1, autopilot="paparazzi", version="5.18")
STATUS = VehicleStatus(
    vehicle_id=5, state="connected", at="2026-11-24T00:00:00+00:00", step="record", armed=True, altitude_m=2.9
)
OPENED = ConnectionOpened(identity=IDENTITY, concern="", held={"kp": 283.0})


def obeys(pipe: Connection, _call: ConnectionRequest) -> None:
    """Takes every order, but to land when it `drifts`."""
    pipe.send(OPENED)
    while isinstance(ordered := pipe.recv(), VehicleCommand):
        problem = "it knows no such block" if ordered.words == "drifts" else ""
        pipe.send(CommandForwarded(ordered, problem))


def is_busy(pipe: Connection, _call: ConnectionRequest) -> None:
    """Looks at no order before the second one, and answers them from the last to the first."""
    pipe.send(OPENED)
    first, second = pipe.recv(), pipe.recv()
    for ordered in (second, first):
        pipe.send(CommandForwarded(ordered))
    pipe.recv()


def dies_of_it(pipe: Connection, _call: ConnectionRequest) -> None:
    pipe.send(OPENED)
    pipe.recv()
    os.kill(os.getpid(), signal.SIGKILL)


def dies_before_it_is_confirmed(pipe: Connection, _call: ConnectionRequest) -> None:
    """Tells of the first order that the vehicle has confirmed it, and dies before it can of the second."""
    pipe.send(OPENED)
    for is_last in (False, True):
        ordered = pipe.recv()
        forwarded = CommandForwarded(ordered, is_awaited=True)
        pipe.send(forwarded)
        if not is_last:
            pipe.send(replace(forwarded, is_awaited=False))
    os.kill(os.getpid(), signal.SIGKILL)


def goes_on(pipe: Connection, _call: ConnectionRequest) -> None:
    """Report the state of the vehicle, then send nothing until a command arrives, then continue."""
    pipe.send(OPENED)
    pipe.send(STATUS)
    ordered = pipe.recv()
    pipe.send(CommandForwarded(ordered))
    pipe.send(STATUS)
    pipe.recv()


def says_nothing(pipe: Connection, _call: ConnectionRequest) -> None:
    pipe.send(OPENED)
    pipe.recv()


def reads_nothing(pipe: Connection, _call: ConnectionRequest) -> None:
    pipe.send(OPENED)
    signal.pause()


LiveMessage = VehicleStatus | CommandForwarded


@contextmanager
def session(
    run: Callable[[Connection, ConnectionRequest], None], folder: Path
) -> Iterator[tuple[VehicleConnection, "queue.SimpleQueue[LiveMessage]"]]:
    """One that is open, and what it hears."""
    heard: queue.SimpleQueue[LiveMessage] = queue.SimpleQueue()
    vehicle = LinkedVehicle(vehicle_id=5, name="Drone", kind="mavlink", options={}, safe_gains={}, identity=None)
    call = ConnectionRequest(vehicle=vehicle, data_dir=folder)
    one = VehicleConnection(call, run, hear=heard.put)
    try:
        assert one.wait_until_open() == OPENED
        yield one, heard
    finally:
        one.close()


def told(answer: Future[str]) -> str:
    return answer.result(Waits.at_most_s)


def next_but_silence(heard: "queue.SimpleQueue[LiveMessage]") -> LiveMessage:
    """What the process says next: on a busy machine it may be shown as not answering before it comes to that."""
    while isinstance(news := heard.get(timeout=Waits.at_most_s), VehicleStatus) and news.state == "not answering":
        pass
    return news


def test_a_command_counts_as_executed_only_once_the_process_confirms_it(tmp_path: Path) -> None:
    with session(is_busy, tmp_path) as (one, heard):
        land = one.send_command("land", "it drifts", 1.0)
        assert not land.done()
        stop = one.send_command("motors off", "people below", 1.0)
        assert (told(stop), told(land)) == ("", "")
        assert [heard.get(timeout=Waits.at_most_s) for _ in range(2)] == [
            CommandForwarded(VehicleCommand(2, "motors off", "people below", 1.0)),
            CommandForwarded(VehicleCommand(1, "land", "it drifts", 1.0)),
        ]


def test_an_order_that_the_vehicle_cannot_be_given_is_answered_with_the_reason(tmp_path: Path) -> None:
    with session(obeys, tmp_path) as (one, _):
        assert told(one.send_command("land", "drifts", 1.0)) == "it knows no such block"
        assert told(one.send_command("motors off", "drifts no more", 1.0)) == ""


def test_orders_to_a_process_that_dies_of_them_are_answered(tmp_path: Path) -> None:
    with session(dies_of_it, tmp_path) as (one, _):
        assert "it is unknown whether the command was sent" in told(one.send_command("land", "it drifts", 1.0))
        assert one.send_command("motors off", "again", 1.0).done()


def test_a_command_whose_confirmation_the_process_did_not_live_to_see_is_told_as_unconfirmed(tmp_path: Path) -> None:
    with session(dies_before_it_is_confirmed, tmp_path) as (one, heard):
        for reason in ("to be sure", "people below"):
            assert told(one.send_command("motors off", reason, 1.0)) == ""
        outcomes = [heard.get(timeout=Waits.at_most_s) for _ in range(2)]
        assert outcomes == [
            CommandForwarded(VehicleCommand(1, "motors off", "to be sure", 1.0)),
            CommandForwarded(
                VehicleCommand(2, "motors off", "people below", 1.0),
                "The process that had the vehicle's link ended before the vehicle confirmed it.",
            ),
        ]


def test_a_process_that_stands_still_is_shown_again_and_again_until_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_module, "SILENT_AFTER_S", 0.05)
    with session(goes_on, tmp_path) as (one, heard):
        assert next_but_silence(heard) == STATUS
        for _ in range(3):
            silent = heard.get(timeout=Waits.at_most_s)
            assert isinstance(silent, VehicleStatus)
            assert (silent.vehicle_id, silent.state, silent.step, silent.armed) == (5, "not answering", "record", True)
            assert "commands do not reach the vehicle" in silent.trouble
            assert "remote control" in silent.trouble
        assert pid_of(one) > 0
        one.send_command("land", "go on", 1.0)
        assert isinstance(next_but_silence(heard), CommandForwarded)
        assert next_but_silence(heard) == STATUS


def test_a_process_that_has_never_told_how_its_vehicle_is_is_shown_as_not_answering_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_module, "SILENT_AFTER_S", 0.05)
    with session(says_nothing, tmp_path) as (_, heard):
        silent = heard.get(timeout=Waits.at_most_s)
        assert isinstance(silent, VehicleStatus)
        assert (silent.vehicle_id, silent.state, silent.armed, silent.concern) == (5, "not answering", None, "")


def test_orders_to_a_process_that_reads_nothing_hold_up_nobody(tmp_path: Path) -> None:
    """Whoever gives them passes on the orders and aborts of every other vehicle too."""
    with session(reads_nothing, tmp_path) as (one, _):
        answers = [one.send_command("land", "again and again", 1.0) for _ in range(5000)]
        assert not answers[0].done()
        assert "not responding" in told(answers[-1])
        os.kill(pid_of(one), signal.SIGKILL)
        assert "it is unknown whether the command was sent" in told(answers[0])
