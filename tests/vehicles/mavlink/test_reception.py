"""One vehicle or two under one system id, by whatever a link does to the packets of one."""

import random
from collections.abc import Iterable
from itertools import chain

import pytest

from app.vehicles.mavlink.reception import DuplicateDetector

Packet = tuple[float, int, bytes, float]
"""Time of arrival, sequence number, frame, and the vehicle's time in it."""


def said(
    vehicle: str,
    *,
    seconds: float = 20.0,
    rate_hz: float = 68.0,
    number: int = 0,
    boot_s: float = 50.0,
    at_s: float = 0.0,
) -> list[Packet]:
    """What one vehicle says, each packet unlike every other."""
    count = round(seconds * rate_hz)
    return [
        (at_s + step / rate_hz, (number + step) % 256, f"{vehicle} {step}".encode(), boot_s + step / rate_hz)
        for step in range(count)
    ]


def heard(packets: Iterable[Packet]) -> tuple[str, float]:
    """What is believed first that is not nothing, and when; nothing, and the end."""
    speakers, at_s = DuplicateDetector(), 0.0
    for at_s, number, frame, boot_s in sorted(packets, key=lambda packet: packet[0]):
        speakers.add(frame, number, at_s, boot_s)
        if doubt := speakers.reason(at_s):
            return doubt, at_s
    return "", at_s


@pytest.mark.parametrize("rate_hz", [12.0, 68.0, 150.0, 400.0])
def test_one_vehicle_is_one_at_any_rate(rate_hz: float) -> None:
    assert heard(said("one", rate_hz=rate_hz))[0] == ""


@pytest.mark.parametrize("gap_s", [0.3, 1.0, 2.0, 2.5, 3.0, 3.7, 5.0, 8.0])
def test_a_link_that_was_lost_is_no_second_vehicle(gap_s: float) -> None:
    assert heard(packet for packet in said("one") if not 5.0 < packet[0] < 5.0 + gap_s)[0] == ""


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_losses_are_no_second_vehicle(share: float) -> None:
    chance = random.Random(1)
    assert heard(packet for packet in said("one", seconds=60.0) if chance.random() > share)[0] == ""


def test_a_stream_that_begins_fast_and_loses_some_is_no_second_vehicle() -> None:
    """Seen: 260 packets a second, a fifth of them lost; the numbers came round before the rate was known."""
    before = said("one", seconds=5.0, rate_hz=8.0)
    stream = said("one at last", seconds=5.0, rate_hz=235.0, number=85, boot_s=55.0, at_s=5.0)
    at_once = [(5.0, 40 + step, f"one {step} at once".encode(), 55.0) for step in range(45)]
    assert heard(packet for packet in chain(before, at_once, stream) if packet[1] % 5)[0] == ""


def test_packets_that_were_held_up_and_many_lost_ones_are_no_second_vehicle() -> None:
    """Seen: five seconds of packets came at once, then no positions; the numbers came round after 230 packets."""
    held_up = [(5.0, number, frame, boot_s) for _, number, frame, boot_s in said("one", seconds=5.0, rate_hz=55.0)]
    following = said("one on", seconds=10.0, rate_hz=55.0, number=275 % 256, boot_s=55.0, at_s=5.0)
    assert heard([*held_up, *(packet for packet in following if packet[1] % 20 == 0)])[0] == ""


def test_packets_that_come_twice_are_no_second_vehicle() -> None:
    again = [(at_s + 0.3, *rest) for at_s, *rest in said("one")[::2]]
    assert heard(chain(said("one"), again))[0] == ""  # type: ignore[arg-type]


@pytest.mark.parametrize("late_s", [0.02, 0.2, 0.7, 1.2])
def test_packets_that_come_late_are_no_second_vehicle(late_s: float) -> None:
    packets = [(at_s + (late_s if step % 5 == 0 else 0.0), *rest) for step, (at_s, *rest) in enumerate(said("one"))]
    assert heard(packets)[0] == ""  # type: ignore[arg-type]


def test_a_reboot_is_no_second_vehicle() -> None:
    before = said("before", seconds=10.0)
    after = said("after", seconds=10.0, at_s=12.0, boot_s=2.0)
    assert heard([*before, *after])[0] == ""


@pytest.mark.parametrize("lost", [0.0, 0.3])
@pytest.mark.parametrize("at_s", [10.1, 10.5, 11.5, 12.9])
@pytest.mark.parametrize("last_number", range(0, 256, 32))
def test_a_reboot_within_a_round_of_sequence_numbers_is_no_second_vehicle(
    last_number: int, at_s: float, lost: float
) -> None:
    chance = random.Random(1)
    before = said("before", seconds=10.0, number=last_number - 680)
    after = said("after", seconds=10.0, at_s=at_s, boot_s=2.0)
    assert heard(packet for packet in [*before, *after] if chance.random() >= lost)[0] == ""


@pytest.mark.parametrize("ahead", range(0, 256, 32))
def test_two_vehicles_on_a_lossy_link_are_noticed(ahead: int) -> None:
    chance = random.Random(1)
    both = [*said("one"), *said("other", number=ahead, at_s=3.005, rate_hz=61.0)]
    doubt, at_s = heard(packet for packet in both if chance.random() > 0.5)
    assert doubt
    assert at_s < 3.005 + 3.0


@pytest.mark.parametrize("ahead", range(0, 256, 16))
@pytest.mark.parametrize("older_s", [0.0, 0.3, 5.0, 3600.0])
def test_two_vehicles_are_noticed_before_a_missing_lift_off_is_judged(ahead: int, older_s: float) -> None:
    """After 1.5 s a Paparazzi that seems to stand has its motors stopped: the second one may be what stands."""
    one = said("one")
    other = said("other", number=ahead, boot_s=50.0 + older_s, at_s=3.005, rate_hz=61.0)
    doubt, at_s = heard([*one, *other])
    assert doubt
    assert at_s < 3.005 + 1.2


def test_the_doubt_is_over_once_one_of_them_is_silent() -> None:
    speakers = DuplicateDetector()
    packets = sorted([*said("one", seconds=30.0), *said("other", number=40, boot_s=7.0, at_s=3.0, seconds=5.0)])
    doubts = []
    for at_s, number, frame, boot_s in packets:
        speakers.add(frame, number, at_s, boot_s)
        doubts.append((at_s, bool(speakers.reason(at_s))))
    doubted = [at_s for at_s, doubt in doubts if doubt]
    assert 3.0 < doubted[0] < 5.0
    assert 12.0 < doubted[-1] < 17.0


def test_copies_of_a_message_that_never_changes_are_no_second_vehicle() -> None:
    """Seen: the frame was forgotten 5 s after it was first sent, though it was sent again every second."""
    detector = DuplicateDetector()
    for count in range(256 * 8):
        now_s, number = count / 256.0, count % 256
        frame = b"constant %d" % number if number % 4 == 0 else b"%d" % count
        detector.add(frame, number, now_s, None)
        if count > 512 and number % 4 == 0:
            detector.add(b"constant %d" % ((number - 128) % 256), (number - 128) % 256, now_s, None)
        assert detector.reason(now_s) == ""
