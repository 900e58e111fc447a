from dataclasses import replace

from app.autopilots.measurements import Position
from tests.vehicles.mavlink.monitors.observing import watch_of
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
