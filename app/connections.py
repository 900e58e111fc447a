"""Open connections of the web server: how many are allowed, how long they may take, and which is closed first.

Descriptors are limited, while opening a connection costs a client nothing. So a new connection is always accepted: at
the limit the one that has waited longest for its client is closed, be it idle, partly sent, or an event stream, which
reconnects by itself. Requests being answered stay; where all others are being answered, the last places are reserved
for requests that end a flight.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final

from app.core.clock import Clock

HEAD_WITHIN_S: Final = 10.0
"""From the connection, or the end of the last response, to the end of a request's headers."""
BODY_SILENCE_S: Final = 20.0
BODY_WITHIN_S: Final = 1800.0
STREAM_AFTER_S: Final = 10.0
"""A response that takes longer is an event stream, or is read slowly."""
RESERVED_DESCRIPTORS: Final = 256
"""Descriptors reserved for the database, files and processes."""
RESERVED_FOR_ABORTS: Final = 64
"""Connections beyond the limit, only for requests that end a flight."""
RESERVED_FOR_ARRIVING: Final = 32
"""Connections beyond those that are being accepted, or were dropped and are being closed."""
MAX_CONNECTIONS: Final = 1024
MAX_CONNECTIONS_PER_DEVICE: Final = 64
"""This computer has no limit of its own, because the operator may be one of its users."""


class Phase(IntEnum):
    """Phase of a connection; at the limit, those in the lowest phase are closed first."""

    IDLE = 0
    HEAD = 1
    BODY = 2
    STREAM = 3
    BUSY = 4


@dataclass(slots=True, eq=False)
class Connection:
    """One connection.

    `client` is the device that it is from, empty for this computer. `drop` closes it at once. `is_held` returns whether
    the server has stopped reading from it, so that its silence is not the client's. `for_stopping`: it was accepted
    beyond the limit, and serves only requests that end a flight.
    """

    client: str
    drop: Callable[[], None]
    is_held: Callable[[], bool]
    phase: Phase = Phase.IDLE
    since_s: float = 0.0
    heard_s: float = 0.0
    for_stopping: bool = False


@dataclass(slots=True)
class Connections:
    """All open connections. For one event loop only.

    `held` counts descriptors; that of a dropped connection is released shortly after.
    """

    most: int
    clock: Clock
    open: dict[Connection, None] = field(default_factory=dict)
    held: int = 0

    def has_room(self, arriving: int) -> bool:
        """Whether another connection can be accepted now, while `arriving` ones are being accepted."""
        return self.held + arriving < self.most + RESERVED_FOR_ABORTS + RESERVED_FOR_ARRIVING

    def add(self, connection: Connection) -> bool:
        """Add a connection, closing another one if necessary. False when it must be closed, because all others are
        being answered."""
        now_s = self.clock.now_s()
        connection.since_s = connection.heard_s = now_s
        own = [each for each in self.open if each.client == connection.client] if connection.client else []
        is_full = len(self.open) >= self.most
        if len(own) >= MAX_CONNECTIONS_PER_DEVICE or is_full:
            goes = self._first_to_go(own if len(own) >= MAX_CONNECTIONS_PER_DEVICE else self.open, now_s)
            if goes is not None:
                self.remove(goes)
                goes.drop()
            elif own or len(self.open) >= self.most + RESERVED_FOR_ABORTS:
                return False
            else:
                connection.for_stopping = True
        self.open[connection] = None
        return True

    def remove(self, connection: Connection) -> None:
        self.open.pop(connection, None)

    def enter(self, connection: Connection, phase: Phase) -> None:
        """Enter a phase; entering the present phase again is no progress."""
        if connection.phase != phase:
            connection.phase, connection.since_s = phase, self.clock.now_s()

    def hear(self, connection: Connection) -> None:
        """Note that the client has sent data."""
        connection.heard_s = self.clock.now_s()

    def drop_overdue(self) -> None:
        """Close connections that take longer than permitted."""
        now_s = self.clock.now_s()
        for connection in [each for each in self.open if _is_overdue(each, now_s)]:
            self.remove(connection)
            connection.drop()

    def _first_to_go(self, among: Iterable[Connection], now_s: float) -> Connection | None:
        waiting = [(phase, each.since_s, each) for each in among if (phase := _standing(each, now_s)) is not Phase.BUSY]
        return min(waiting, key=lambda one: one[:2])[2] if waiting else None


def room_for_connections(descriptors: int) -> int:
    """Maximum number of connections besides `RESERVED_FOR_ABORTS`, given the process's limit of open files."""
    return min(
        MAX_CONNECTIONS,
        max(descriptors - RESERVED_DESCRIPTORS, descriptors // 2) - RESERVED_FOR_ABORTS - RESERVED_FOR_ARRIVING,
    )


def _standing(connection: Connection, now_s: float) -> Phase:
    took_long = connection.phase is Phase.BUSY and now_s - connection.since_s > STREAM_AFTER_S
    return Phase.STREAM if took_long else connection.phase


def _is_overdue(connection: Connection, now_s: float) -> bool:
    match connection.phase:
        case Phase.IDLE | Phase.HEAD:
            return now_s - connection.since_s > HEAD_WITHIN_S
        case Phase.BODY:
            is_silent = now_s - connection.heard_s > BODY_SILENCE_S and not connection.is_held()
            return is_silent or now_s - connection.since_s > BODY_WITHIN_S
        case _:
            return False
