"""The connections that the web server has open: how many there may be, how long they may take, and who goes first.

Descriptors are few, and a connection costs whoever opens it nothing. So a new one always gets in: where there is no
room the one goes that has been waiting longest for its client, be it silent, half sent or an event stream, which comes
back by itself. What is being answered stays; where nothing else is open, the last places are for what ends a flight.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final

from app.core.clock import Clock

HEAD_WITHIN_S: Final = 10.0
"""From the connection, or the end of the last answer, to the end of a request's headers."""
BODY_SILENCE_S: Final = 20.0
BODY_WITHIN_S: Final = 1800.0
STREAM_AFTER_S: Final = 10.0
"""An answer that takes longer is an event stream, or is read slowly."""
RESERVED_DESCRIPTORS: Final = 256
"""Descriptors that are left to the database, files and processes."""
RESERVED_FOR_ABORTS: Final = 64
"""Connections beyond the limit that serve nothing but what ends a flight."""
RESERVED_FOR_ARRIVING: Final = 32
"""Connections beyond those that are on their way in, or were dropped and are on their way out."""
MAX_CONNECTIONS: Final = 1024
MAX_CONNECTIONS_PER_DEVICE: Final = 64
"""This computer itself has no limit of its own: the operator is one of its users."""


class Phase(IntEnum):
    """What a connection does; where room is needed, those of the first phase go first."""

    IDLE = 0
    HEAD = 1
    BODY = 2
    STREAM = 3
    BUSY = 4


@dataclass(slots=True, eq=False)
class Connection:
    """One connection. `client` is the device that it is from, empty for this computer; `drop` closes it at once;
    `is_held` says whether we have stopped reading from it, so that its silence is ours. `for_stopping`: it came where
    no room was left, and serves nothing but what ends a flight."""

    client: str
    drop: Callable[[], None]
    is_held: Callable[[], bool]
    phase: Phase = Phase.IDLE
    since_s: float = 0.0
    heard_s: float = 0.0
    for_stopping: bool = False


@dataclass(slots=True)
class Connections:
    """All of them. One event loop only. `held` counts descriptors: those of connections that were dropped go a moment
    later."""

    most: int
    clock: Clock
    open: dict[Connection, None] = field(default_factory=dict)
    held: int = 0

    def has_room(self, arriving: int) -> bool:
        """Whether another one can be taken while so many are on their way in; in a moment it can be."""
        return self.held + arriving < self.most + RESERVED_FOR_ABORTS + RESERVED_FOR_ARRIVING

    def add(self, connection: Connection) -> bool:
        """Take it in, if need be in another's place. False when it must be closed: everybody is being answered."""
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
        """It goes on to another phase; entering the same one again is no progress."""
        if connection.phase != phase:
            connection.phase, connection.since_s = phase, self.clock.now_s()

    def hear(self, connection: Connection) -> None:
        """Its client has sent something."""
        connection.heard_s = self.clock.now_s()

    def drop_overdue(self) -> None:
        """Close what takes longer than it may."""
        now_s = self.clock.now_s()
        for connection in [each for each in self.open if _is_overdue(each, now_s)]:
            self.remove(connection)
            connection.drop()

    def _first_to_go(self, among: Iterable[Connection], now_s: float) -> Connection | None:
        waiting = [(phase, each.since_s, each) for each in among if (phase := _standing(each, now_s)) is not Phase.BUSY]
        return min(waiting, key=lambda one: one[:2])[2] if waiting else None


def room_for_connections(descriptors: int) -> int:
    """How many connections there may be beside `RESERVED_FOR_ABORTS`, where the process may have so many open files."""
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
