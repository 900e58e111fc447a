"""Bytes over real sockets and a real terminal line."""

import os
import pty
import socket
import threading
import tty
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.transports import BACKLOG, LinkError, Transport, open_transport
from tests.ports import free_port
from tests.vehicles.mavlink.speaking import LOOPBACK
from tests.waiting import Waits, eventually, wait_for


def hear(transport: Transport, size: int) -> bytes:
    """The next `size` bytes or more."""
    data = bytearray()
    wait_for(
        f"{size} bytes",
        lambda: len(data) >= size,
        lambda: data.extend(b"".join(piece for piece, _ in transport.read(0.1))),
    )
    return bytes(data)


@pytest.fixture
def vehicle() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind((LOOPBACK, 0))
        vehicle.settimeout(Waits.at_most_s)
        yield vehicle


# ---- UDP


def test_a_datagram_comes_with_its_sender_and_what_is_written_goes_to_the_vehicle(vehicle: socket.socket) -> None:
    local = free_port()
    with (
        closing(open_transport(Address("udp", LOOPBACK, vehicle.getsockname()[1], local))) as transport,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        stranger.sendto(b"stranger", (LOOPBACK, local))
        vehicle.sendto(b"vehicle", (LOOPBACK, local))
        senders = [peer for _, peer in transport.read(Waits.at_most_s) + transport.read(0.1)]
        assert senders == [(LOOPBACK, stranger.getsockname()[1]), vehicle.getsockname()]
        assert transport.write(b"command")
        assert vehicle.recvfrom(100) == (b"command", (LOOPBACK, local))


def test_a_vehicle_that_is_not_there_yet_is_no_error(vehicle: socket.socket) -> None:
    """The operating system reports "port unreachable"; a drone that boots later must be heard all the same."""
    port, local = free_port(), free_port()
    with closing(open_transport(Address("udp", LOOPBACK, port, local))) as transport:
        for _ in range(3):
            transport.write(b"anybody?")
            assert transport.read(0.01) == []
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as late:
            late.bind((LOOPBACK, port))
            late.sendto(b"here", (LOOPBACK, local))
            assert hear(transport, 4) == b"here"


def test_at_our_own_address_nobody_is_written_to_until_one_is_adopted(vehicle: socket.socket) -> None:
    local = free_port()
    with (
        closing(open_transport(Address("udpin", LOOPBACK, local))) as transport,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        assert transport.remote is None
        assert not transport.write(b"to whom?")
        stranger.sendto(b"one", (LOOPBACK, local))
        vehicle.sendto(b"two", (LOOPBACK, local))
        assert hear(transport, 6) == b"onetwo"
        transport.remote = vehicle.getsockname()
        stranger.sendto(b"three", (LOOPBACK, local))
        vehicle.sendto(b"four", (LOOPBACK, local))
        assert hear(transport, 9) == b"threefour"
        assert transport.write(b"command")
        assert vehicle.recv(100) == b"command"


def test_a_port_that_another_program_listens_at_is_refused(vehicle: socket.socket) -> None:
    with pytest.raises(LinkError, match="Address already in use") as refusal:
        open_transport(Address("udpin", *vehicle.getsockname()))
    assert "no other program" in refusal.value.hint


def test_a_host_without_an_address_is_refused() -> None:
    with pytest.raises(LinkError, match=r"udp:drone\.invalid:4245 could not be opened"):
        open_transport(Address("udp", "drone.invalid", 4245))


def test_a_network_that_takes_nothing_is_no_error() -> None:
    with closing(open_transport(Address("udp", "255.255.255.255", 4245))) as transport:  # broadcasts were not asked for
        assert not transport.write(b"command")


def test_a_burst_is_read_to_its_last_datagram(vehicle: socket.socket) -> None:
    local = free_port()
    with closing(open_transport(Address("udp", LOOPBACK, vehicle.getsockname()[1], local))) as transport:
        for number in range(1000):
            vehicle.sendto(b"%04d" % number, (LOOPBACK, local))
        assert hear(transport, 4000) == b"".join(b"%04d" % number for number in range(1000))


def test_a_reader_that_waits_is_woken_by_another_thread() -> None:
    with closing(open_transport(Address("udpin", LOOPBACK, free_port()))) as transport:
        reader = threading.Thread(target=transport.read, args=(2 * Waits.at_most_s,))
        reader.start()
        transport.wake()
        reader.join(Waits.at_most_s)
        assert not reader.is_alive()


# ---- TCP


def test_a_broken_connection_is_silence_until_it_is_open_again() -> None:
    with socket.create_server((LOOPBACK, 0)) as server:
        address = Address("tcp", LOOPBACK, server.getsockname()[1])
        with closing(open_transport(address)) as transport:
            first, _ = server.accept()
            first.sendall(b"first")
            assert hear(transport, 5) == b"first"
            first.close()
            eventually(lambda: transport.read(0.01) == [] and not transport.write(b"lost"))
            server.settimeout(Waits.at_most_s)
            reader = threading.Thread(target=lambda: setattr(reader, "heard", hear(transport, 6)))
            reader.start()
            second, _ = server.accept()
            with second:
                second.sendall(b"second")
                reader.join()
                assert vars(reader)["heard"] == b"second"
                assert transport.write(b"command")
                second.settimeout(Waits.at_most_s)
                assert second.recv(100) == b"command"


def test_a_vehicle_that_takes_no_connections_is_refused() -> None:
    with pytest.raises(LinkError, match="Connection refused"):
        open_transport(Address("tcp", LOOPBACK, free_port()))


def test_writing_never_waits_for_a_peer_that_does_not_read() -> None:
    """What was taken arrives whole and in order; the rest is refused rather than sent much later."""
    with (
        socket.create_server((LOOPBACK, 0)) as server,
        closing(open_transport(Address("tcp", LOOPBACK, server.getsockname()[1]))) as transport,
    ):
        peer, _ = server.accept()
        taken = bytearray()
        with peer:
            while transport.write(block := b"%08d" % len(taken) * 64):
                taken += block
            assert len(taken) > BACKLOG
            arrived = bytearray()
            peer.settimeout(Waits.at_most_s)
            while len(arrived) < len(taken):
                transport.read(0.0)
                arrived += peer.recv(1 << 20)
            assert arrived == taken


# ---- a serial line


@pytest.fixture
def line(tmp_path: Path) -> Iterator[tuple[int, Path]]:
    """The vehicle's end of a line, and the name of the device that is ours."""
    vehicle, device = plugged(tmp_path / "ttyRadio")
    yield vehicle, device
    os.close(vehicle)


def plugged(name: Path) -> tuple[int, Path]:
    vehicle, ours = pty.openpty()
    tty.setraw(ours)
    name.unlink(missing_ok=True)
    name.symlink_to(os.ttyname(ours))
    os.close(ours)
    return vehicle, name


def test_a_serial_line_carries_every_byte_both_ways(line: tuple[int, Path]) -> None:
    vehicle, device = line
    everything = bytes(range(256))
    with closing(open_transport(Address("serial", str(device), 57600))) as transport:
        os.write(vehicle, everything)
        assert hear(transport, 256) == everything
        assert transport.remote == (str(device), 57600)
        assert transport.write(everything)
        assert os.read(vehicle, 1000) == everything
        assert transport.read(0.01) == []


def test_a_radio_that_is_pulled_out_and_put_back_is_heard_again(tmp_path: Path) -> None:
    vehicle, device = plugged(tmp_path / "ttyRadio")
    with closing(open_transport(Address("serial", str(device), 57600))) as transport:
        os.write(vehicle, b"before")
        assert hear(transport, 6) == b"before"
        os.close(vehicle)
        eventually(lambda: transport.read(0.01) == [] and not transport.write(b"lost"))
        vehicle, _ = plugged(device)
        eventually(lambda: transport.read(0.05) == [] and transport.write(b"after"))
        assert os.read(vehicle, 100) == b"after"
    os.close(vehicle)


def test_a_radio_that_stays_away_is_tried_again_and_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.vehicles.mavlink.transports.REOPEN_EVERY_S", 0.02)
    vehicle, device = plugged(tmp_path / "ttyRadio")
    with closing(open_transport(Address("serial", str(device), 57600))) as transport:
        os.close(vehicle)
        device.unlink()
        assert not transport.write(b"lost")  # before the reader has noticed
        assert not transport.write(b"lost")
        for _ in range(5):
            assert transport.read(0.05) == []
        vehicle, _ = plugged(device)
        eventually(lambda: transport.read(0.05) == [] and transport.write(b"after"))
        assert os.read(vehicle, 100) == b"after"
    os.close(vehicle)


def test_a_radio_that_was_pulled_out_can_be_closed(tmp_path: Path) -> None:
    vehicle, device = plugged(tmp_path / "ttyRadio")
    transport = open_transport(Address("serial", str(device), 57600))
    os.close(vehicle)
    eventually(lambda: transport.read(0.01) == [] and not transport.write(b"lost"))
    transport.close()


def test_a_device_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="No such file"):
        open_transport(Address("serial", str(tmp_path / "ttyUSB0"), 57600))


def test_a_baud_rate_of_no_device_is_refused(line: tuple[int, Path]) -> None:
    with pytest.raises(LinkError, match="could not be opened"):
        open_transport(Address("serial", str(line[1]), 10**12))
