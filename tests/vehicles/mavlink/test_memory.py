"""When a vehicle on the ground has restarted, by the clock in its positions."""

from collections.abc import Iterable
from dataclasses import replace

import pytest

from app.autopilots.measurements import Position
from app.vehicles.mavlink.memory import RestartCounter

AT_REST = Position(time_boot_s=0.0, altitude_m=0.0, climb_rate_m_s=0.0, east_m=0.0, north_m=0.0)
Received = tuple[float, float]
"""Time of receipt by our clock, time since boot; both in s."""


def every_40_ms(seconds: float, *, from_s: float, boot_s: float) -> list[Received]:
    return [(from_s + 0.04 * n, boot_s + 0.04 * n) for n in range(round(seconds / 0.04))]


def restarts_of(*received: Iterable[Received]) -> int:
    counter = RestartCounter()
    for now_s, boot_s in (each for some in received for each in some):
        counter.take(replace(AT_REST, time_boot_s=boot_s), now_s)
    return counter.restarts


BEFORE = every_40_ms(10.0, from_s=0.0, boot_s=500.0)


def test_a_clock_that_begins_anew_is_one_restart() -> None:
    assert restarts_of(BEFORE, every_40_ms(10.0, from_s=12.0, boot_s=1.5)) == 1


def test_a_restart_during_a_long_silence_counts_although_the_clock_is_ahead_of_the_last_one_heard() -> None:
    young = every_40_ms(2.0, from_s=0.0, boot_s=40.0)
    assert restarts_of(young, every_40_ms(2.0, from_s=120.0, boot_s=60.0)) == 1


def test_a_long_silence_without_a_restart_is_none() -> None:
    assert restarts_of(BEFORE, every_40_ms(2.0, from_s=610.0, boot_s=1108.0)) == 0


def test_a_simulation_that_stood_still_while_nothing_was_heard_has_not_restarted() -> None:
    """Observed defect: after a drone's process had been stopped for a minute on the ground, it was said to have
    restarted. Its clock was too old for that."""
    assert restarts_of(BEFORE, every_40_ms(2.0, from_s=70.0, boot_s=511.0)) == 0


def test_every_further_restart_counts() -> None:
    again = every_40_ms(10.0, from_s=12.0, boot_s=1.5)
    assert restarts_of(BEFORE, again, every_40_ms(10.0, from_s=24.0, boot_s=1.5)) == 2


@pytest.mark.parametrize(
    "others",
    [
        [(10.1, 3.0)],
        [(10.1, 3.0), (10.2, 77.0), (10.3, 1e6), (10.9, 2.0)],
        [(10.0 + 0.04 * n, 3.0) for n in range(50)],
        [(10.0 + 0.04 * n, 505.0 + 0.04 * n) for n in range(5)],
    ],
    ids=["one packet", "corrupted packets", "one packet repeated for two seconds", "a burst of late packets"],
)
def test_packets_by_another_clock_that_does_not_go_on_are_no_restart(others: list[Received]) -> None:
    assert restarts_of(BEFORE, others, every_40_ms(10.0, from_s=12.0, boot_s=512.0)) == 0


@pytest.mark.parametrize(
    "strangers", [[(0.0, 0.2)], [(float(n), 3600.0 + n) for n in range(8)]], ids=["one packet", "one every second"]
)
def test_a_stranger_heard_before_the_vehicles_own_positions_were_requested_is_no_restart(
    strangers: list[Received],
) -> None:
    begun_s = strangers[-1][0] + 0.5
    every_second = [(begun_s + float(n), 3600.0 + begun_s + n) for n in range(10) if len(strangers) > 1]
    own = every_40_ms(10.0, from_s=begun_s, boot_s=5.0)
    assert restarts_of(strangers, sorted([*own, *every_second])) == 0


def test_a_second_vehicle_with_the_same_ids_is_no_restart() -> None:
    both = sorted(every_40_ms(10.0, from_s=10.0, boot_s=510.0) + every_40_ms(10.0, from_s=10.02, boot_s=7.0))
    assert restarts_of(BEFORE, both) == 0


def test_a_link_that_becomes_seconds_late_is_no_restart() -> None:
    assert restarts_of(BEFORE, every_40_ms(10.0, from_s=14.5, boot_s=510.0)) == 0


def test_a_link_that_catches_up_is_no_restart() -> None:
    caught_up = [(14.5, 510.0 + 0.04 * n) for n in range(100)]
    assert restarts_of(BEFORE, caught_up, every_40_ms(10.0, from_s=14.54, boot_s=514.0)) == 0


def test_a_clock_that_has_jumped_ahead_while_this_computer_slept_counts_as_a_restart() -> None:
    assert restarts_of(BEFORE, every_40_ms(10.0, from_s=10.0, boot_s=1100.0)) == 1
