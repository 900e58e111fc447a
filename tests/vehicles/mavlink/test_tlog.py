"""Telemetry logs, read back with the MAVLink library's own reader."""

import os
import resource
import time
from contextlib import closing
from pathlib import Path

import pytest
from pymavlink import mavutil

from app.autopilots.dialects import ARDUPILOTMEGA, PAPARAZZI, Dialect, FieldValue, Message, number, text
from app.core.clock import ScaledClock
from app.vehicles.mavlink.link import Link
from app.vehicles.mavlink.tlog import TlogWriter, record
from app.vehicles.mavlink.transports import LinkError
from tests.vehicles.mavlink.speaking import FakeVehicleEndpoint, collect, heartbeat, position
from tests.waiting import eventually

GAIN: dict[str, FieldValue] = {
    "target_system": 31,
    "target_component": 0,
    "param_id": "gui_v_kp",
    "param_value": 283.0,
    "param_type": 9,
}


def read(path: Path, dialect: Dialect, monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, Message]]:
    """Every message of a log with its Unix time, s. The library's reader takes its dialect from the environment."""
    for name in ("MAVLINK20", "MAVLINK09"):
        monkeypatch.delenv(name, raising=False)
    if dialect.mavlink == 2:
        monkeypatch.setenv("MAVLINK20", "1")
    mavutil.set_dialect(dialect.name)
    log = mavutil.mavlink_connection(str(path), dialect=dialect.name)
    messages = iter(log.recv_msg, None)
    found = [(message._timestamp, message) for message in messages]
    log.close()
    return found


@pytest.mark.parametrize("dialect", [PAPARAZZI, ARDUPILOTMEGA], ids=lambda dialect: dialect.name)
def test_both_directions_are_read_back_in_order_with_their_times(
    dialect: Dialect, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "flight.tlog"
    started_s = time.time()
    with FakeVehicleEndpoint(dialect) as vehicle:
        with closing(Link(vehicle.address, dialect, clock=ScaledClock(), target_system=31, tlog=path)) as link:
            for step in range(200):
                vehicle.say("LOCAL_POSITION_NED", **position(20 * step, z=-0.5))
            assert len(collect(link, 200)) == 200
            link.send("PARAM_SET", **GAIN)
            eventually(lambda: any(message.get_type() == "PARAM_SET" for message in vehicle.hear()))
            vehicle.send(heartbeat(vehicle))
            assert len(collect(link, 1)) == 1
        assert link.log_problem is None
    ended_s = time.time()
    logged = [(at_s, message) for at_s, message in read(path, dialect, monkeypatch) if message.get_srcSystem() == 31]
    sent = [message for _, message in read(path, dialect, monkeypatch) if message.get_type() == "PARAM_SET"]
    kinds = [message.get_type() for _, message in logged]
    assert kinds == ["LOCAL_POSITION_NED"] * 200 + ["HEARTBEAT"]
    assert [number(message, "time_boot_ms") for _, message in logged[:200]] == [20 * step for step in range(200)]
    assert [
        (message.get_srcSystem(), text(message, "param_id"), number(message, "param_value")) for message in sent
    ] == [(255, "gui_v_kp", 283.0)]
    times = [at_s for at_s, _ in logged]
    assert times == sorted(times)
    assert started_s - 0.01 <= times[0] <= times[-1] <= ended_s + 0.01


def test_what_was_dropped_is_not_in_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "flight.tlog"
    with FakeVehicleEndpoint(PAPARAZZI) as vehicle:
        other = PAPARAZZI.codec(system=7, component=1)
        with closing(Link(vehicle.address, PAPARAZZI, clock=ScaledClock(), target_system=31, tlog=path)) as link:
            vehicle.send(other.pack(PAPARAZZI.message("LOCAL_POSITION_NED", position(20))) + b"noise")
            vehicle.say("LOCAL_POSITION_NED", **position(40))
            assert len(collect(link, 1)) == 1
    assert [number(message, "time_boot_ms") for _, message in read(path, PAPARAZZI, monkeypatch)] == [40]


def test_a_log_runs_in_vehicle_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "flight.tlog"
    clock = ScaledClock(100.0)
    heard = []
    with (
        FakeVehicleEndpoint(PAPARAZZI) as vehicle,
        closing(Link(vehicle.address, PAPARAZZI, clock=clock, target_system=31, tlog=path)) as link,
    ):
        for step in range(2):
            vehicle.say("LOCAL_POSITION_NED", **position(step))
            heard += collect(link, 1)
            clock.wait_s(10.0)
    first_s, second_s = (at_s for at_s, _ in read(path, PAPARAZZI, monkeypatch))
    assert second_s - first_s == pytest.approx(heard[1].received_s - heard[0].received_s, abs=1.0)
    assert second_s - first_s >= 10.0


def test_a_record_is_eight_bytes_of_time_and_the_frame() -> None:
    assert record(0x0102030405060708, b"frame").hex() == "0102030405060708" + b"frame".hex()
    assert record(7, b"")[-1] == 4  # the two lowest bits are not time


def test_a_log_is_continued_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    for frame in (b"one", b"two"):
        log = TlogWriter(path)
        log.write(8, frame)
        log.close()
    assert path.read_bytes() == record(8, b"one") + record(8, b"two")


def test_a_frame_is_in_the_file_soon_though_the_log_is_open(tmp_path: Path) -> None:
    log = TlogWriter(tmp_path / "flight.tlog")
    log.write(8, b"frame")
    eventually(lambda: (tmp_path / "flight.tlog").read_bytes() == record(8, b"frame"))
    log.close()


@pytest.mark.complete
def test_a_disk_that_stalls_keeps_nothing_waiting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe without a reader accepts only 64 kB."""
    monkeypatch.setattr("app.vehicles.mavlink.tlog.STORED_WITHIN_S", 0.2)
    path = tmp_path / "stalled.tlog"
    os.mkfifo(path)
    nobody = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with FakeVehicleEndpoint(PAPARAZZI) as vehicle:
        link = Link(vehicle.address, PAPARAZZI, clock=ScaledClock(), target_system=31, tlog=path)
        for step in range(3000):
            vehicle.say("LOCAL_POSITION_NED", **position(step))
            if step % 100 == 99:
                assert len(collect(link, 100)) == 100
        link.send("PARAM_SET", **GAIN)
        assert vehicle.hear()
        link.close()
        assert link.log_problem == f"{path} was not stored within 0.2 s"
    os.close(nobody)


def test_what_a_full_disk_did_not_take_is_stored_when_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file may not grow beyond 1000 bytes for a while: the operating system's own limit."""
    path = tmp_path / "flight.tlog"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    monkeypatch.setattr("app.vehicles.mavlink.tlog.FLUSH_EVERY_S", 0.01)
    log = TlogWriter(path)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
        for step in range(100):
            log.write(8 * step, b"a frame")
        eventually(lambda: log.problem == f"{path} is not complete: File too large")
        assert path.stat().st_size == 1000
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    log.write(800, b"a frame")
    eventually(lambda: log.problem is None)
    log.close()
    assert path.read_bytes() == b"".join(record(8 * step, b"a frame") for step in range(101))


def test_a_full_disk_is_reported_and_does_not_end_the_link(monkeypatch: pytest.MonkeyPatch) -> None:
    with (
        FakeVehicleEndpoint(PAPARAZZI) as vehicle,
        closing(
            Link(vehicle.address, PAPARAZZI, clock=ScaledClock(), target_system=31, tlog=Path("/dev/full"))
        ) as link,
    ):
        for step in range(3):
            vehicle.say("LOCAL_POSITION_NED", **position(step))
            assert len(collect(link, 1)) == 1
        eventually(lambda: link.log_problem == "/dev/full is not complete: No space left on device")


def test_a_log_that_cannot_be_opened_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="Is a directory"):
        TlogWriter(tmp_path)
