"""Transports of bytes to and from a vehicle over UDP, TCP or a serial line; times are seconds of wall time.

A broken connection appears as silence, not as an error, and is reopened automatically, so that the loss of a link in
flight is handled in the same way for all transports.
"""

import contextlib
import os
import select
import socket
import termios
import threading
import time
from collections.abc import Callable
from typing import Final, Protocol

import serial

from app.vehicles.base import VehicleError
from app.vehicles.mavlink.addresses import Address, is_loopback_host

Peer = tuple[str, int]
"""Sender of data: host and port, or device and baud rate."""

BATCH: Final = 64
"""Maximum number of datagrams per read, so that sending is possible between reads."""
LARGEST_READ: Final = 65536
RECEIVE_BUFFER: Final = 1 << 20
BACKLOG: Final = 4096
"""Bytes that may wait for a stalled stream: 0.7 s at 57 600 baud. Beyond that, commands would be late."""
REOPEN_EVERY_S: Final = 1.0


class LinkError(VehicleError):
    """The link to a vehicle could not be opened, or has failed."""


class Transport(Protocol):
    """Transport to and from one peer. One thread reads and closes; any thread may `write` and `wake` until then."""

    remote: Peer | None
    """Peer that `write` sends to; None until it is known and set."""

    def read(self, timeout_s: float) -> list[tuple[bytes, Peer]]:
        """Return the data received, each a datagram or a piece of a stream, with its sender: over UDP anybody can send.
        Waits at most `timeout_s` for the first, or until `wake`."""

    def write(self, data: bytes) -> bool:
        """Send without waiting; return false without a peer or connection, or if the buffer is full."""

    def wake(self) -> None:
        """Make a `read` of another thread return at once."""

    def close(self) -> None: ...


def open_transport(address: Address) -> Transport:
    """Open the transport of an address. Raises LinkError if it cannot be opened."""
    place, number = address.place, address.number
    match address.kind:
        case "udp":
            ours = ("127.0.0.1" if is_loopback_host(place) else "0.0.0.0", address.local_port or 0)  # noqa: S104
            return UdpTransport(ours, _resolved(address))
        case "udpin":
            return UdpTransport(_resolved(address), None)
        case "tcp":
            return StreamTransport((place, number), lambda: _connected(place, number))
        case "serial":
            return StreamTransport((place, number), lambda: _serial_port(place, number))


class UdpTransport:
    """Datagrams between our address and one peer's."""

    def __init__(self, local: Peer, remote: Peer | None) -> None:
        """Bind the socket. Raises LinkError if `local` is in use: two receivers on one port would lose packets to each
        other."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        try:
            self._socket.bind(local)
        except OSError as error:
            self._socket.close()
            raise _cannot_open(f"udp port {local[1]} of {local[0]}", error) from error
        self._waiter = _Waiter()
        self.remote = remote

    def read(self, timeout_s: float) -> list[tuple[bytes, Peer]]:
        datagrams: list[tuple[bytes, Peer]] = []
        is_readable, _ = self._waiter.wait(timeout_s, self._socket.fileno())
        if is_readable:
            with contextlib.suppress(BlockingIOError):
                while len(datagrams) < BATCH:
                    datagrams.append(self._socket.recvfrom(LARGEST_READ))
        return datagrams

    def write(self, data: bytes) -> bool:
        if self.remote is None:
            return False
        try:
            self._socket.sendto(data, self.remote)
        except OSError:  # the buffer is full or the network is down; the next one may succeed
            return False
        return True

    def wake(self) -> None:
        self._waiter.wake()

    def close(self) -> None:
        self._waiter.close()
        self._socket.close()


_Stream = socket.socket | serial.Serial
"""An open, non-blocking descriptor."""


class StreamTransport:
    """Stream of bytes to and from one peer; after it has broken, opening is retried every second."""

    def __init__(self, peer: Peer, opened: Callable[[], _Stream]) -> None:
        """Open the stream by `opened`, which raises OSError on failure. Raises LinkError if that fails now."""
        self.remote: Peer | None = peer
        self._opened, self._peer = opened, peer
        try:
            self._stream: _Stream | None = opened()
        except OSError as error:
            raise _cannot_open(f"{peer[0]}:{peer[1]}", error) from error
        self._waiter = _Waiter()
        self._next_try_s = 0.0
        # Other threads use only the stream's descriptor, under this lock; the reader closes a broken stream.
        self._writing = threading.Lock()
        self._backlog = bytearray()
        self._is_broken = False

    def read(self, timeout_s: float) -> list[tuple[bytes, Peer]]:
        if self._is_broken:
            self._break()
        if self._stream is None:
            self._waiter.wait(min(timeout_s, max(self._next_try_s - time.monotonic(), 0.0)))
            self._reopen()
            return []
        is_readable, is_writable = self._waiter.wait(timeout_s, self._stream.fileno(), writes=bool(self._backlog))
        if is_writable:
            with self._writing:
                self._flush(self._stream)
        data = self._receive(self._stream) if is_readable else b""
        return [(data, self._peer)] if data else []

    def write(self, data: bytes) -> bool:
        with self._writing:
            if self._stream is None or self._is_broken or len(self._backlog) + len(data) > BACKLOG:
                return False
            self._backlog += data
            self._flush(self._stream)
            if self._backlog or self._is_broken:
                self._waiter.wake()
            return not self._is_broken

    def wake(self) -> None:
        self._waiter.wake()

    def close(self) -> None:
        if self._stream is not None:
            self._stream.close()
        self._waiter.close()

    def _receive(self, stream: _Stream) -> bytes:
        """Read a readable stream; if it contains nothing, it has ended."""
        try:
            data = os.read(stream.fileno(), LARGEST_READ)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._is_broken = True
        return data

    def _flush(self, stream: _Stream) -> None:
        """Write as much of the backlog as the stream accepts now."""
        try:
            del self._backlog[: os.write(stream.fileno(), self._backlog)]
        except BlockingIOError:
            pass
        except OSError:
            self._is_broken = True

    def _break(self) -> None:
        with self._writing:
            if self._stream is not None:
                self._stream.close()
            self._stream = None
            self._backlog.clear()
            self._is_broken = False
        self._next_try_s = time.monotonic() + REOPEN_EVERY_S

    def _reopen(self) -> None:
        if time.monotonic() < self._next_try_s:
            return
        try:
            self._stream = self._opened()
        except OSError:
            self._next_try_s = time.monotonic() + REOPEN_EVERY_S


class _Waiter:
    """Waits for a descriptor, or for `wake` from another thread."""

    def __init__(self) -> None:
        self._wake_receiver, self._wake_sender = socket.socketpair()
        self._wake_receiver.setblocking(False)
        self._wake_sender.setblocking(False)

    def wait(self, timeout_s: float, descriptor: int | None = None, *, writes: bool = False) -> tuple[bool, bool]:
        """Return whether the descriptor is readable, and with `writes` writable; neither after a timeout or wake."""
        polled = select.poll()
        polled.register(self._wake_receiver, select.POLLIN)
        if descriptor is not None:
            polled.register(descriptor, select.POLLIN | (select.POLLOUT if writes else 0))
        found = dict(polled.poll(max(timeout_s, 0.0) * 1000.0))
        if self._wake_receiver.fileno() in found:
            with contextlib.suppress(BlockingIOError):
                self._wake_receiver.recv(LARGEST_READ)
        events = 0 if descriptor is None else found.get(descriptor, 0)
        return bool(events & ~select.POLLOUT), bool(events & ~select.POLLIN)

    def wake(self) -> None:
        with contextlib.suppress(OSError):  # full of wakes, or closed by the waiting thread
            self._wake_sender.send(b"!")

    def close(self) -> None:
        self._wake_receiver.close()
        self._wake_sender.close()


def _connected(host: str, port: int) -> socket.socket:
    connection = socket.create_connection((host, port), timeout=2.0)
    connection.setblocking(False)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BACKLOG)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux: a vehicle that is switched off does not close the connection
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 5000)
    return connection


def _serial_port(device: str, baud: int) -> serial.Serial:
    """Open a serial port by pyserial; it is read and written by its descriptor: pyserial's `write` may block."""
    try:
        return serial.Serial(device, baud, timeout=0, exclusive=True)
    except (ValueError, OverflowError, termios.error) as error:  # such as a baud rate that no device knows
        raise OSError(str(error)) from error


def _resolved(address: Address) -> Peer:
    try:
        found = socket.getaddrinfo(address.place, address.number, socket.AF_INET, socket.SOCK_DGRAM)
    except OSError as error:
        raise _cannot_open(str(address), error) from error
    return str(found[0][4][0]), address.number


def _cannot_open(what: str, error: OSError) -> LinkError:
    return LinkError(
        f"{what} could not be opened: {error.strerror or error}.",
        hint="Check that the address is correct, the vehicle is connected, and no other program uses it.",
    )
