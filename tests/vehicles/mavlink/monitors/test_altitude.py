from dataclasses import replace

import pytest

from app.autopilots.measurements import Position
from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.monitors.altitude import SecondSourceMonitor
from tests.vehicles.mavlink.monitors.observing import failure_of, watch_of
from tests.vehicles.mavlink.walking import GROUND_M, PLAN


def test_a_lone_jump_is_dropped_and_counted() -> None:
    watch = watch_of(3.0, 3.0, 3.6)
    assert (watch.last, watch.positions.glitches) == (Position(10.02, 3.0, 0.0), 0)
    watch, kept = watch.update(Position(10.06, 3.0, 0.0), 10.06, PLAN)
    assert kept == (Position(10.06, 3.0, 0.0),)
    assert watch.positions.glitches == 1


def test_a_jump_that_stays_is_where_the_vehicle_is() -> None:
    watch = watch_of(3.0, 3.0, 3.6)
    watch, kept = watch.update(Position(10.06, 3.6, 0.0), 10.06, PLAN)
    assert [position.time_boot_s for position in kept] == [10.04, 10.06]
    assert watch.positions.glitches == 0


def test_more_than_three_glitches_are_too_many() -> None:
    watch = watch_of(*[3.0, 3.0, 3.6] * 3, 3.0)
    assert (watch.positions.glitches, watch.positions.find_glitches()) == (3, None)
    assert replace(watch.positions, glitches=4).find_glitches() is not None


def test_the_ground_takes_height_and_speed_and_a_fresh_sample() -> None:
    resting = watch_of(0.2, 0.2)
    assert resting.positions.is_grounded(10.1, GROUND_M)
    assert not resting.positions.is_grounded(10.6, GROUND_M)
    assert not watch_of(0.26, 0.26).positions.is_grounded(10.1, GROUND_M)
    assert not watch_of(0.2, 0.2, climb_rate_m_s=0.2).positions.is_grounded(10.1, GROUND_M)


def seen(*samples: tuple[float, float], vehicle_m: float = 3.0, is_new: bool = True) -> SecondSourceMonitor:
    """After samples (time, altitude) of a vehicle at `vehicle_m` by its own altitude."""
    second = SecondSourceMonitor()
    for at_s, altitude_m in samples:
        second = second.update(SecondaryAltitudeReceived(altitude_m, is_new=is_new, now_s=at_s), vehicle_m)
    return second


@pytest.mark.parametrize(
    ("off_m", "until_s", "failure"), [(0.31, 10.31, "F9c"), (0.31, 10.29, None), (0.29, 12.0, None)]
)
def test_two_sources_more_than_0_3_m_apart_for_0_3_s_disagree(
    off_m: float, until_s: float, failure: str | None
) -> None:
    assert failure_of(seen((10.0, 3.0 + off_m), (until_s, 3.0 + off_m)).find_disagreement()) == failure


def test_a_source_that_is_not_tracked_is_blind_after_a_quarter_of_a_second() -> None:
    lost = [(10.0 + 0.05 * count, 3.0) for count in range(7)]
    assert seen(*lost[:6], is_new=False).find_blind(PLAN, 10.3) is None
    assert seen(*lost, is_new=False).find_blind(PLAN, 10.3) is not None
    assert seen(*lost, is_new=False).altitude_at(10.3) is None


def test_a_source_that_is_silent_is_blind_and_no_source_is_not() -> None:
    assert seen((10.0, 3.0)).find_blind(PLAN, 11.1) is not None
    assert SecondSourceMonitor().find_blind(PLAN, 11.1) is None
    assert (seen((10.0, 3.0)).altitude_at(10.4), seen((10.0, 3.0)).altitude_at(10.6)) == (3.0, None)


def test_a_shift_of_the_ground_goes_along_with_the_second_source() -> None:
    second = seen((10.0, 0.1))
    assert second.find_disagreement_on_ground(0.6, 0.5, 10.1) is None
    assert second.find_disagreement_on_ground(0.6, 0.0, 10.1) is not None
