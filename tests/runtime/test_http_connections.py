"""How many connections there are, how long they may take, and who goes first."""

from collections.abc import Callable

import pytest

from app.runtime.http_connections import (
    BODY_SILENCE_S,
    BODY_WITHIN_S,
    HEAD_WITHIN_S,
    MAX_CONNECTIONS_PER_DEVICE,
    RESERVED_FOR_ABORTS,
    RESERVED_FOR_ARRIVING,
    STREAM_AFTER_S,
    Connection,
    Connections,
    Phase,
    room_for_connections,
)
from tests.clocks import ManualClock

TABLET = "192.0.2.9"


class Table:
    """Connections with a clock of the test's, and which of them were dropped."""

    def __init__(self, most: int) -> None:
        self.clock = ManualClock()
        self.all = Connections(most, self.clock)
        self.dropped: list[Connection] = []
        self.held = False

    def pass_s(self, seconds: float) -> None:
        self.clock.time_s += seconds

    def open(self, client: str = "", phase: Phase = Phase.IDLE) -> Connection:
        """One that has come as far as this phase, a moment after the last."""
        connection = Connection(client, lambda: self.dropped.append(connection), lambda: self.held)
        self.pass_s(0.001)
        self.taken = self.all.add(connection)
        self.all.enter(connection, phase)
        return connection


def test_the_oldest_silent_connection_makes_room_for_a_new_one() -> None:
    table = Table(3)
    first, second, third = (table.open() for _ in range(3))
    assert table.dropped == []
    table.open()
    assert table.dropped == [first]
    table.open()
    assert table.dropped == [first, second]
    assert third in table.all.open
    assert len(table.all.open) == 3


def test_who_is_silent_goes_before_who_has_begun_to_speak_and_what_is_answered_stays() -> None:
    table = Table(4)
    phases = (Phase.BUSY, Phase.BODY, Phase.HEAD, Phase.IDLE)
    busy, body, head, idle = (table.open(phase=phase) for phase in phases)
    for _ in range(3):
        table.open(phase=Phase.BUSY)
    assert table.dropped == [idle, head, body]
    assert busy in table.all.open


def test_an_event_stream_makes_room_where_everything_else_is_being_answered() -> None:
    table = Table(2)
    stream = table.open(phase=Phase.BUSY)
    table.pass_s(STREAM_AFTER_S + 0.1)
    table.open(phase=Phase.BUSY)
    table.open(phase=Phase.BUSY)
    assert table.dropped == [stream]


def test_the_last_places_are_for_stopping_and_beyond_them_nobody_is_taken() -> None:
    table = Table(1)
    assert not table.open(phase=Phase.BUSY).for_stopping
    last = [table.open(phase=Phase.BUSY) for _ in range(RESERVED_FOR_ABORTS)]
    assert all(each.for_stopping for each in last)
    assert table.dropped == []
    table.open()
    assert not table.taken
    assert len(table.all.open) == 1 + RESERVED_FOR_ABORTS


def test_another_device_has_a_limit_of_its_own_and_this_computer_none() -> None:
    table = Table(10 * MAX_CONNECTIONS_PER_DEVICE)
    here = [table.open() for _ in range(2 * MAX_CONNECTIONS_PER_DEVICE)]
    there = [table.open(TABLET) for _ in range(MAX_CONNECTIONS_PER_DEVICE + 1)]
    assert table.dropped == there[:1]
    assert all(each in table.all.open for each in here)
    for each in there[1:]:
        table.all.enter(each, Phase.BUSY)
    table.open(TABLET)
    assert not table.taken


@pytest.mark.parametrize(
    ("phase", "within_s"), [(Phase.IDLE, HEAD_WITHIN_S), (Phase.HEAD, HEAD_WITHIN_S), (Phase.BODY, BODY_SILENCE_S)]
)
def test_what_its_client_does_not_go_on_with_is_closed(phase: Phase, within_s: float) -> None:
    table = Table(5)
    slow, busy = table.open(phase=phase), table.open(phase=Phase.BUSY)
    table.pass_s(within_s - 0.1)
    table.all.drop_overdue()
    assert table.dropped == []
    table.pass_s(0.2)
    table.all.drop_overdue()
    assert table.dropped == [slow]
    assert list(table.all.open) == [busy]


def drip(table: Table, connection: Connection, until: Callable[[], bool]) -> float:
    """Send a byte every second until that; how long it took."""
    begun_s = table.clock.now_s()
    while not until():
        table.pass_s(1.0)
        table.all.hear(connection)
        table.all.enter(connection, connection.phase)
        table.all.drop_overdue()
    return table.clock.now_s() - begun_s


@pytest.mark.parametrize(("phase", "within_s"), [(Phase.HEAD, HEAD_WITHIN_S), (Phase.BODY, BODY_WITHIN_S)])
def test_a_byte_a_second_keeps_nothing_open_for_ever(phase: Phase, within_s: float) -> None:
    table = Table(5)
    slow = table.open(phase=phase)
    assert drip(table, slow, lambda: table.dropped == [slow]) == pytest.approx(within_s + 1.0, abs=1.0)


def test_a_body_that_we_do_not_read_on_is_not_held_against_its_client() -> None:
    table = Table(5)
    table.open(phase=Phase.BODY)
    table.held = True
    table.pass_s(10 * BODY_SILENCE_S)
    table.all.drop_overdue()
    assert table.dropped == []


@pytest.mark.parametrize(("descriptors", "most"), [(1024, 672), (256, 32), (4096, 1024), (2**20, 1024)])
def test_descriptors_are_left_for_all_else(descriptors: int, most: int) -> None:
    assert room_for_connections(descriptors) == most
    assert descriptors - most - RESERVED_FOR_ABORTS - RESERVED_FOR_ARRIVING >= min(256, descriptors // 2)
