"""A link and a vehicle that talk over the loopback interface."""

import math
import os
import pty
import socket
import threading
import tty
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from app.autopilots.dialects import (
    ARDUPILOTMEGA,
    COMMON,
    PAPARAZZI,
    Dialect,
    FieldValue,
    Message,
    number,
    text,
)
from app.core.clock import ScaledClock
from app.core.errors import InputError
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.link import (
    MAX_QUEUED_MESSAGES,
    UNATTENDED_AFTER_S,
    Link,
)
from app.vehicles.mavlink.reception import GONE_AFTER_S, INTERVAL_S, LossCounter
from app.vehicles.mavlink.transports import LinkError
from tests.clocks import ManualClock
from tests.vehicles.mavlink.replaying import FLOWN, recorded
from tests.vehicles.mavlink.speaking import (
    LOOPBACK,
    FakeVehicleEndpoint,
    collect,
    heartbeat,
    position,
)
from tests.waiting import Waits, eventually

GAIN: dict[str, FieldValue] = {
    "target_system": 31,
    "target_component": 0,
    "param_id": "gui_v_kp",
    "param_value": 283.0,
    "param_type": 9,
}
BEAT: dict[str, FieldValue] = {
    "type": 2,
    "autopilot": 9,
    "base_mode": 0,
    "custom_mode": 0,
    "system_status": 3,
    "mavlink_version": 3,
}
CLOCK = ScaledClock()


@pytest.fixture
def paparazzi() -> Iterator[FakeVehicleEndpoint]:
    with FakeVehicleEndpoint(PAPARAZZI, component=190) as speaker:
        yield speaker


@pytest.fixture
def link(paparazzi: FakeVehicleEndpoint) -> Iterator[Link]:
    with closing(Link(paparazzi.address, PAPARAZZI, clock=CLOCK, target_system=31)) as link:
        yield link


# ---- hearing


def test_messages_are_handed_over_in_order_with_the_time_of_their_receipt(
    paparazzi: FakeVehicleEndpoint, link: Link
) -> None:
    before_s = CLOCK.now_s()
    for step in range(300):
        paparazzi.say("LOCAL_POSITION_NED", **position(20 * step, z=-0.01 * step))
    heard = collect(link, 300)
    assert [number(each.message, "time_boot_ms") for each in heard] == [20 * step for step in range(300)]
    assert number(heard[-1].message, "z") == pytest.approx(-2.99)
    times = [each.received_s for each in heard]
    assert before_s <= times[0]
    assert times == sorted(times)
    assert link.health.received == 300
    assert (link.health.lost, link.health.foreign) == (0, 0)
    assert link.health.last_packet_s == times[-1]


class HurriedClock(ScaledClock):
    """Notes for how long the test's own thread waits, and does not let it."""

    def __init__(self) -> None:
        super().__init__()
        self.asked_s: list[float] = []

    def wall_s(self, seconds: float) -> float:
        if threading.current_thread() is not threading.main_thread():
            return super().wall_s(seconds)
        self.asked_s.append(seconds)
        return 0.0


def test_a_call_waits_no_longer_than_asked_by_the_clock(paparazzi: FakeVehicleEndpoint) -> None:
    clock = HurriedClock()
    with closing(Link(paparazzi.address, PAPARAZZI, clock=clock, target_system=31)) as link:
        assert link.receive(3600.0) == []
    assert clock.asked_s == [3600.0]


def test_another_system_at_the_vehicles_address_is_dropped_and_counted(
    paparazzi: FakeVehicleEndpoint, link: Link
) -> None:
    other = PAPARAZZI.codec(system=7, component=1)
    paparazzi.send(other.pack(PAPARAZZI.message("LOCAL_POSITION_NED", position(20))))
    paparazzi.say("LOCAL_POSITION_NED", **position(40))
    assert [number(each.message, "time_boot_ms") for each in collect(link, 1)] == [40]
    assert link.health.foreign == 1
    assert link.health.received == 1


def test_another_sender_with_the_vehicles_system_id_is_dropped_and_counted(
    paparazzi: FakeVehicleEndpoint, link: Link
) -> None:
    with FakeVehicleEndpoint(PAPARAZZI, component=190) as impostor:
        impostor.ground = paparazzi.ground
        impostor.say("LOCAL_POSITION_NED", **position(20))
        paparazzi.say("LOCAL_POSITION_NED", **position(40))
        assert [number(each.message, "time_boot_ms") for each in collect(link, 1)] == [40]
    assert link.health.foreign == 1


@contextmanager
def link_beside(
    paparazzi: FakeVehicleEndpoint, host: str = "127.0.0.1"
) -> Iterator[tuple[Link, FakeVehicleEndpoint, ManualClock]]:
    """A link that has heard its vehicle, and another sender."""
    clock = ManualClock()
    with (
        closing(Link(paparazzi.address, PAPARAZZI, clock=clock, target_system=31)) as link,
        FakeVehicleEndpoint(PAPARAZZI, component=190, host=host) as other,
    ):
        paparazzi.send(heartbeat(paparazzi, autopilot=9))
        collect(link, 1)
        other.ground = paparazzi.ground
        yield link, other, clock


def wait_until_dropped(link: Link, datagrams: int) -> None:
    eventually(lambda: link.health.foreign == datagrams)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2"])
def test_another_vehicle_with_its_system_id_makes_the_link_doubtful_by_its_third_message(
    paparazzi: FakeVehicleEndpoint, host: str
) -> None:
    with link_beside(paparazzi, host) as (link, other, clock):
        for count in (1, 2, 3):
            assert link.duplicate_reason == "", "one message, or two, may be anybody's"
            clock.time_s += INTERVAL_S
            other.say("LOCAL_POSITION_NED", **position(20 * count))
            wait_until_dropped(link, count)
            paparazzi.say("LOCAL_POSITION_NED", **position(20 * count))
            collect(link, 1)
        assert link.duplicate_reason == "Another vehicle with the same system id sends from another address."


def test_copies_of_the_vehicles_packets_from_another_port_say_nothing(paparazzi: FakeVehicleEndpoint) -> None:
    with link_beside(paparazzi) as (link, other, clock):
        for count in range(1, 6):
            frame = paparazzi.codec.pack(PAPARAZZI.message("LOCAL_POSITION_NED", position(20 * count)))
            paparazzi.send(frame)
            collect(link, 1)
            clock.time_s += INTERVAL_S
            other.send(frame)
            wait_until_dropped(link, count)
        assert link.duplicate_reason == ""


def test_a_vehicle_whose_packets_go_on_from_another_port_is_followed_there_at_once(
    paparazzi: FakeVehicleEndpoint,
) -> None:
    with link_beside(paparazzi) as (link, moved, clock):
        moved.codec = paparazzi.codec
        for count in (1, 2, 3):
            clock.time_s += INTERVAL_S
            moved.say("LOCAL_POSITION_NED", **position(20 * count))
            wait_until_dropped(link, min(count, 2))
        assert [number(each.message, "time_boot_ms") for each in collect(link, 1)] == [60], "within 0.6 s"
        link.send("PARAM_SET", **GAIN)
        assert [message.get_type() for message in moved.hear()] == ["PARAM_SET"]
        assert link.duplicate_reason == ""


def test_another_vehicle_is_found_by_any_of_its_messages_beside_a_host_that_floods_the_link(
    paparazzi: FakeVehicleEndpoint,
) -> None:
    """One interval was shared by all hosts, and only a heartbeat counted: a flood hid the other vehicle."""
    with (
        link_beside(paparazzi, "127.0.0.2") as (link, other, clock),
        FakeVehicleEndpoint(PAPARAZZI, component=7, host="127.0.0.3") as noisy,
    ):
        noisy.ground = paparazzi.ground
        for count in (1, 2, 3):
            clock.time_s += INTERVAL_S
            noisy.say("LOCAL_POSITION_NED", **position(20 * count))
            other.say("LOCAL_POSITION_NED", **position(20 * count))
            wait_until_dropped(link, 2 * count)
            paparazzi.say("LOCAL_POSITION_NED", **position(20 * count))
            collect(link, 1)
        assert link.duplicate_reason


def test_a_vehicle_that_returns_from_another_port_is_received_and_commanded_again(
    paparazzi: FakeVehicleEndpoint,
) -> None:
    clock = ManualClock()
    with (
        closing(Link(paparazzi.address, PAPARAZZI, clock=clock, target_system=31)) as link,
        FakeVehicleEndpoint(PAPARAZZI, component=190) as again,
    ):
        paparazzi.send(heartbeat(paparazzi, autopilot=9))
        collect(link, 1)
        clock.time_s += GONE_AFTER_S + 0.1
        again.ground = paparazzi.ground
        again.send(heartbeat(again, autopilot=9))
        eventually(lambda: link.health.foreign == 1)
        again.say("LOCAL_POSITION_NED", **position(60))
        assert [number(each.message, "time_boot_ms") for each in collect(link, 1)] == [60]
        link.send("PARAM_SET", **GAIN)
        assert [message.get_type() for message in again.hear()] == ["PARAM_SET"]
        assert link.duplicate_reason == ""


def test_messages_of_another_component_do_not_count_as_the_autopilots(
    paparazzi: FakeVehicleEndpoint, link: Link
) -> None:
    paparazzi.send(heartbeat(paparazzi, autopilot=9))
    [beat] = collect(link, 1)
    companion = PAPARAZZI.codec(system=31, component=191)
    paparazzi.send(companion.pack(PAPARAZZI.message("LOCAL_POSITION_NED", position(20))))
    [sample] = collect(link, 1)
    assert sample.message.get_srcComponent() == 191
    assert link.health.last_packet_s == beat.received_s
    paparazzi.send(companion.pack(PAPARAZZI.message("HEARTBEAT", BEAT | {"autopilot": 9})))
    collect(link, 1)
    assert link.health.last_heartbeat_s == beat.received_s


def test_without_a_system_id_the_first_autopilot_is_taken_not_a_ground_station(paparazzi: FakeVehicleEndpoint) -> None:
    with closing(Link(paparazzi.address, PAPARAZZI, clock=CLOCK)) as link:
        station = FakeVehicleEndpoint(PAPARAZZI, system=255)
        with station:
            paparazzi.send(heartbeat(station, autopilot=8, kind=6))
        paparazzi.say("LOCAL_POSITION_NED", **position(20))
        assert link.receive(0.0) == []
        paparazzi.send(heartbeat(paparazzi, autopilot=9))
        paparazzi.say("LOCAL_POSITION_NED", **position(40))
        beat, sample = collect(link, 2)
        assert (beat.message.get_type(), sample.message.get_type()) == ("HEARTBEAT", "LOCAL_POSITION_NED")
        assert link._vehicle_system == 31
        assert link.health.foreign == 2
        assert link.health.last_heartbeat_s == beat.received_s
        assert link.health.last_packet_s == sample.received_s


def test_strangers_at_our_own_address_do_not_keep_the_vehicle_out() -> None:
    with (
        FakeVehicleEndpoint(ARDUPILOTMEGA, system=1) as vehicle,
        FakeVehicleEndpoint(ARDUPILOTMEGA, system=9) as stranger,
        closing(Link(vehicle.ground_address, ARDUPILOTMEGA, clock=CLOCK, target_system=1)) as link,
    ):
        stranger.ground = vehicle.ground
        stranger.beat()
        stranger.send(b"\xfd\xff")  # the beginning of a frame that would swallow what follows
        link.send("COMMAND_LONG", **command(400))  # to nobody yet
        eventually(lambda: link.health.foreign == 2)
        vehicle.beat()
        assert [each.message.get_srcSystem() for each in collect(link, 1)] == [1]
        link.send("COMMAND_LONG", **command(21))
        commands = [message for message in vehicle.hear() + vehicle.hear() if message.get_type() == "COMMAND_LONG"]
        assert [number(message, "command") for message in commands] == [21]
        stranger.beat()
        eventually(lambda: link.health.foreign == 3)


def command(number: int) -> dict[str, FieldValue]:
    parameters: dict[str, FieldValue] = {f"param{index}": 0.0 for index in range(1, 8)}
    return {"target_system": 1, "target_component": 1, "command": number, "confirmation": 0, **parameters}


def test_noise_is_dropped_and_what_follows_is_heard(paparazzi: FakeVehicleEndpoint, link: Link) -> None:
    damaged = bytearray(paparazzi.frame("LOCAL_POSITION_NED", **position(20)))
    damaged[10] ^= 0x10
    paparazzi.send(bytes(damaged))
    paparazzi.send(b"modem: OK\r\n")
    paparazzi.say("LOCAL_POSITION_NED", **position(40))
    assert [number(each.message, "time_boot_ms") for each in collect(link, 1)] == [40]
    assert (link.health.received, link.health.lost) == (1, 0)


def test_what_is_missing_in_the_sequence_is_counted_as_lost(paparazzi: FakeVehicleEndpoint, link: Link) -> None:
    frames = [paparazzi.frame("LOCAL_POSITION_NED", **position(20 * step)) for step in range(600)]
    for step, frame in enumerate(frames):
        if step % 100 != 50:
            paparazzi.send(frame)
    assert len(collect(link, 594)) == 594
    assert link.health.lost == 6


def test_a_newer_message_is_not_handed_over_yet_counts_in_the_sequence() -> None:
    """PX4 sends ids unknown to the dialect. Their checksums cannot be verified, so they are no sign of life."""
    with (
        FakeVehicleEndpoint(COMMON, system=1) as vehicle,
        closing(Link(vehicle.address, COMMON, clock=CLOCK, target_system=1)) as link,
    ):
        vehicle.beat()
        assert len(collect(link, 1)) == 1
        unknown = bytearray(vehicle.frame("LOCAL_POSITION_NED", **position(20)))
        unknown[7:10] = (60_000).to_bytes(3, "little")
        vehicle.send(bytes(unknown))
        vehicle.say("LOCAL_POSITION_NED", **position(40))
        assert [each.message.get_type() for each in collect(link, 1)] == ["LOCAL_POSITION_NED"]
        assert (link.health.lost, link.health.received) == (0, 2)


def test_paparazzis_other_counters_are_left_out_of_the_losses() -> None:
    losses = LossCounter(PAPARAZZI.uncounted)
    for number_ in (10, 11, 12):
        losses.count("LOCAL_POSITION_NED", 190, number_)
        losses.count("SCRIPT_CURRENT", 190, 200)
        losses.count("MISSION_ACK", 190, 77)
    assert losses.lost == 0


@pytest.mark.complete
@pytest.mark.parametrize("gains", FLOWN)
def test_a_recorded_flight_of_the_real_paparazzi_is_heard_whole_with_nothing_lost(
    gains: tuple[int, int, int], paparazzi: FakeVehicleEndpoint, link: Link
) -> None:
    said = [each.message for each in recorded(gains) if each.is_from_vehicle]
    heard = []
    for start in range(0, len(said), 200):
        for message in said[start : start + 200]:
            paparazzi.send(bytes(message.get_msgbuf()))
        heard += collect(link, len(said[start : start + 200]))
    assert [bytes(each.message.get_msgbuf()) for each in heard] == [bytes(message.get_msgbuf()) for message in said]
    assert (link.health.received, link.health.lost) == (len(said), 0)


def test_overtaken_and_repeated_packets_are_not_losses() -> None:
    losses = LossCounter(())
    for number_ in (254, 0, 255, 0, 1, 1, 2):
        losses.count("HEARTBEAT", 1, number_)
    assert losses.lost == 1
    losses.count("HEARTBEAT", 2, 100)
    assert losses.lost == 1


def test_a_slow_reader_loses_the_oldest_packets(
    paparazzi: FakeVehicleEndpoint, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert MAX_QUEUED_MESSAGES >= 50 * 60  # a minute of telemetry at least
    monkeypatch.setattr("app.vehicles.mavlink.link.MAX_QUEUED_MESSAGES", 5)
    with closing(Link(paparazzi.address, PAPARAZZI, clock=CLOCK, target_system=31)) as link:
        for step in range(8):
            paparazzi.say("LOCAL_POSITION_NED", **position(step))
        eventually(lambda: link.health.received == 8)
        assert [number(each.message, "time_boot_ms") for each in link.receive(1.0)] == [3, 4, 5, 6, 7]


# ---- sending


def test_a_frame_of_mavlink_2_is_never_sent_to_paparazzi(paparazzi: FakeVehicleEndpoint, link: Link) -> None:
    """Not even after one was received, which is what switches other programs over."""
    newer = COMMON.codec(system=31, component=190)
    paparazzi.send(newer.pack(COMMON.message("LOCAL_POSITION_NED", position(20))))
    assert len(collect(link, 1)) == 1
    for _ in range(3):
        link.send("PARAM_SET", **GAIN)
        (heard,) = paparazzi.hear()
        assert (text(heard, "param_id"), number(heard, "param_value")) == ("gui_v_kp", 283.0)
    assert [frame[0] for frame in paparazzi.frames] == [0xFE] * 3
    assert "MAVLINK20" not in os.environ


@pytest.mark.parametrize("dialect", [ARDUPILOTMEGA, COMMON], ids=lambda dialect: dialect.name)
def test_others_are_sent_mavlink_2(dialect: Dialect) -> None:
    with (
        FakeVehicleEndpoint(dialect, system=1) as vehicle,
        closing(Link(vehicle.address, dialect, clock=CLOCK, target_system=1)) as link,
    ):
        link.send("PARAM_SET", **GAIN)
        assert vehicle.hear()
        assert vehicle.frames[0][0] == 0xFD


@pytest.mark.parametrize(
    ("kind", "fields", "reason"),
    [
        ("PARAM_SETT", GAIN, "no message PARAM_SETT"),
        ("PARAM_SET", GAIN | {"gain": 1.0}, "unexpected keyword argument 'gain'"),
        ("PARAM_SET", {"param_id": "gui_v_kp"}, "missing 4 required"),
        ("PARAM_SET", GAIN | {"target_system": 256}, "0 <= number <= 255"),
        ("PARAM_SET", GAIN | {"target_system": 1.5}, "required argument is not an integer"),
        ("PARAM_SET", GAIN | {"param_value": "283"}, "not a float"),
        ("PARAM_SET", GAIN | {"param_value": 1e300}, "float too large"),
        ("PARAM_SET", GAIN | {"param_id": "gui_v_ada_thr_enabled"}, "param_id holds 16 characters"),
        ("PARAM_SET", GAIN | {"param_id": "größe"}, "'ascii' codec can't encode"),
        ("PARAM_SET", GAIN | {"param_id": 1.0}, "no attribute .split."),
    ],
)
def test_what_cannot_be_sent_is_refused_to_the_caller_at_once(
    link: Link, kind: str, fields: dict[str, FieldValue], reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        link.send(kind, **fields)


def test_many_threads_send_and_every_message_leaves_once(paparazzi: FakeVehicleEndpoint, link: Link) -> None:
    paparazzi.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)

    def send(first: int) -> None:
        for value in range(first, first + 20):
            link.send("PARAM_SET", **GAIN | {"param_value": float(value)})

    with ThreadPoolExecutor(10) as threads:
        list(threads.map(send, range(0, 200, 20)))
    heard = [paparazzi.hear()[0] for _ in range(200)]
    assert sorted(number(message, "param_value") for message in heard) == [float(value) for value in range(200)]
    assert [frame[2] for frame in paparazzi.frames] == list(range(200))  # the sequence numbers


def test_every_command_is_on_the_wire_while_telemetry_streams(paparazzi: FakeVehicleEndpoint, link: Link) -> None:
    done = threading.Event()

    def stream() -> None:
        while not done.wait(0.002):
            paparazzi.say("LOCAL_POSITION_NED", **position(0))

    telemetry = threading.Thread(target=stream)
    telemetry.start()
    try:
        for _ in range(50):  # how soon: bench/link.py measures it
            link.send("PARAM_SET", **GAIN)
            assert paparazzi.hear()
    finally:
        done.set()
        telemetry.join()


# ---- heartbeats


class Tapped:
    """A link on a clock that stands, and the heartbeats that reach the vehicle."""

    def __init__(self, vehicle: FakeVehicleEndpoint, clock: ManualClock, link: Link) -> None:
        self.vehicle, self.clock, self.link = vehicle, clock, link
        self.beats: list[Message] = []

    def at(self, time_s: float) -> int:
        """How many heartbeats have come when the clock shows that, and the link's thread has seen it do so."""
        self.clock.time_s = time_s
        for _ in range(2):  # it looks at the clock after the first, and before it takes in the second
            before = self.link.health.received
            self.vehicle.say("LOCAL_POSITION_NED", **position(0))
            eventually(lambda: self.link.health.received == before + 1)  # noqa: B023 - called at once
        while heard := self.vehicle.hear(0.01):
            self.beats += [message for message in heard if message.get_type() == "HEARTBEAT"]
        return len(self.beats)


@contextmanager
def tapped(dialect: Dialect, system: int) -> Iterator[Tapped]:
    clock = ManualClock()
    with (
        FakeVehicleEndpoint(dialect, system=system) as vehicle,
        closing(Link(vehicle.address, dialect, clock=clock, target_system=system)) as link,
    ):
        yield Tapped(vehicle, clock, link)


def test_a_ground_stations_heartbeat_goes_out_every_second_of_the_clock() -> None:
    with tapped(ARDUPILOTMEGA, 1) as tap:
        assert tap.at(0.0) == 1
        assert tap.at(0.9) == 1
        for second in range(1, 8):
            tap.link.receive(0.0)
            assert tap.at(float(second)) == 1 + second
    first = tap.beats[0]
    assert (first.get_srcSystem(), first.get_srcComponent()) == (255, 190)
    assert (number(first, "type"), number(first, "autopilot")) == (6, 8)


def test_no_heartbeat_pretends_that_a_hung_program_is_there() -> None:
    """The vehicle's own answer to a lost ground station must be able to act."""
    with tapped(ARDUPILOTMEGA, 1) as tap:
        counted = [tap.at(float(second)) for second in range(10)]
        assert counted[-1] <= UNATTENDED_AFTER_S
        assert counted[3:] == [counted[3]] * 7
        tap.link.receive(0.0)
        assert tap.at(10.0) == counted[-1] + 1


def test_paparazzi_is_not_bothered_with_heartbeats() -> None:
    with tapped(PAPARAZZI, 31) as tap:
        assert [tap.at(float(second)) for second in range(3)] == [0, 0, 0]


# ---- the end


def test_what_was_sent_before_closing_still_leaves(paparazzi: FakeVehicleEndpoint) -> None:
    link = Link(paparazzi.address, PAPARAZZI, clock=CLOCK, target_system=31)
    for value in range(5):
        link.send("PARAM_SET", **GAIN | {"param_value": float(value)})
    link.close()
    assert [number(paparazzi.hear()[0], "param_value") for _ in range(5)] == [0.0, 1.0, 2.0, 3.0, 4.0]
    link.close()  # again is harmless


def test_a_closed_link_returns_what_it_received_and_then_reports_that_it_is_closed(
    paparazzi: FakeVehicleEndpoint,
) -> None:
    link = Link(paparazzi.address, PAPARAZZI, clock=CLOCK, target_system=31)
    paparazzi.say("LOCAL_POSITION_NED", **position(20))
    eventually(lambda: link.health.received == 1)
    link.close()
    assert len(link.receive(1.0)) == 1
    for call in (lambda: link.receive(1.0), lambda: link.send("PARAM_SET", **GAIN)):
        with pytest.raises(LinkError, match=r"is closed\. Connect to the vehicle again"):
            call()


def test_closing_ends_the_wait_of_another_thread(paparazzi: FakeVehicleEndpoint) -> None:
    link = Link(paparazzi.address, PAPARAZZI, clock=CLOCK, target_system=31)
    closer = threading.Timer(0.05, link.close)
    closer.start()
    with pytest.raises(LinkError):
        link.receive(60.0)
    closer.join()


class BrokenClock(ScaledClock):
    """Fails once it is asked to."""

    is_broken = False

    def now_s(self) -> float:
        if self.is_broken and threading.current_thread().name.startswith("link"):
            raise OverflowError("the clock is broken")
        return super().now_s()


def test_a_link_whose_thread_fails_reports_it_to_all_users(
    paparazzi: FakeVehicleEndpoint, monkeypatch: pytest.MonkeyPatch
) -> None:
    reported: list[str] = []
    monkeypatch.setattr(threading, "excepthook", lambda failure: reported.append(str(failure.exc_value)))
    clock = BrokenClock()
    with closing(Link(paparazzi.address, PAPARAZZI, clock=clock, target_system=31)) as link:
        clock.is_broken = True
        paparazzi.say("LOCAL_POSITION_NED", **position(20))
        with pytest.raises(LinkError, match=r"failed: the clock is broken\."):
            link.receive(Waits.at_most_s)
        with pytest.raises(LinkError, match="failed: the clock is broken"):
            link.send("PARAM_SET", **GAIN)
    assert reported == ["the clock is broken"]


# ---- other carriers


def test_a_link_over_tcp_outlives_the_connection() -> None:
    with (
        socket.create_server((LOOPBACK, 0)) as server,
        FakeVehicleEndpoint(COMMON, system=1) as vehicle,
        closing(Link(Address("tcp", LOOPBACK, server.getsockname()[1]), COMMON, clock=CLOCK)) as link,
    ):
        server.settimeout(Waits.at_most_s)
        for _ in range(2):
            connection, _ = server.accept()
            with connection:
                connection.setblocking(True)
                frame = heartbeat(vehicle, autopilot=12)
                connection.sendall(frame[:5])  # a stream is cut anywhere
                connection.sendall(frame[5:])
                assert [each.message.get_type() for each in collect(link, 1)] == ["HEARTBEAT"]
                link.send("COMMAND_LONG", **command(21))
                assert "COMMAND_LONG" in kinds_heard(vehicle, connection.fileno())
        assert link.health.received == 2


def test_a_link_over_a_serial_line() -> None:
    vehicle_end, our_end = pty.openpty()
    tty.setraw(our_end)
    with (
        FakeVehicleEndpoint(ARDUPILOTMEGA, system=1) as vehicle,
        closing(Link(Address("serial", os.ttyname(our_end), 57600), ARDUPILOTMEGA, clock=CLOCK)) as link,
    ):
        os.write(vehicle_end, b"\x00\x55" + heartbeat(vehicle))
        assert [each.message.get_srcSystem() for each in collect(link, 1)] == [1]
        link.send("COMMAND_LONG", **command(21))
        assert "COMMAND_LONG" in kinds_heard(vehicle, vehicle_end)
    os.close(vehicle_end)
    os.close(our_end)


def kinds_heard(vehicle: FakeVehicleEndpoint, descriptor: int) -> list[str]:
    """What arrives up to the first message that is no heartbeat."""
    kinds: list[str] = []
    while not kinds or kinds[-1] == "HEARTBEAT":
        kinds += [message.get_type() for message in vehicle.codec.parse(os.read(descriptor, 4096))]
    return kinds


def test_a_folder_that_is_not_there_leaves_nothing_open(paparazzi: FakeVehicleEndpoint, tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="telemetry log"):
        Link(paparazzi.address, PAPARAZZI, clock=CLOCK, tlog=tmp_path / "none" / "flight.tlog")
    Link(paparazzi.address, PAPARAZZI, clock=CLOCK).close()  # the port is free again


def test_a_stream_that_is_always_cut_within_a_frame_takes_no_more_memory() -> None:
    sender = COMMON.codec(system=1, component=1)
    receiver = COMMON.codec(system=255, component=190)
    frames = [sender.pack(COMMON.message("LOCAL_POSITION_NED", position(step))) for step in range(1000)]
    heard: list[Message] = []
    for frame, following in pairwise(frames):
        heard += receiver.parse(frame[1:] + following[:1] if heard else frame + following[:1])
    assert [number(message, "time_boot_ms") for message in heard] == list(range(999))
    assert len(receiver._in.buf) < 10_000 < len(b"".join(frames))


@pytest.mark.parametrize("speed", [0.0, -1.0, math.inf, math.nan])
def test_a_clock_that_cannot_run_is_refused(speed: float) -> None:
    with pytest.raises(InputError) as refusal:
        ScaledClock(speed)
    assert refusal.value.problems[0].field == "clock_speed"
