from app.vehicles.mavlink.monitors.ground import GroundMonitor
from tests.vehicles.mavlink.monitors.observing import failure_of


def test_a_landing_is_believed_once_it_was_reported_for_a_second_and_still_is() -> None:
    ground = GroundMonitor().update(True, 10.0).update(True, 11.0)
    assert (ground.has_reported_landing(10.9), ground.has_reported_landing(11.0)) == (False, True)
    assert not ground.has_reported_landing(12.1)
    assert not ground.update(False, 11.1).update(True, 11.2).has_reported_landing(11.3)


def test_the_ground_counts_from_when_every_source_shows_it() -> None:
    ground = (
        GroundMonitor().settle(10.0, grounded=True, said_to_fly=False).settle(10.5, grounded=True, said_to_fly=False)
    )
    assert ground.grounded_since_s == 10.0
    assert ground.settle(10.6, grounded=True, said_to_fly=True).grounded_since_s is None


def test_a_vehicle_that_reports_for_8_s_that_it_flies_contradicts_an_altitude_on_the_ground() -> None:
    ground = GroundMonitor()
    for tenths in range(100, 182):
        ground = ground.update(False, tenths / 10.0).settle(tenths / 10.0, grounded=True, said_to_fly=True)
    assert ground.find_contradiction(18.0) is None
    assert failure_of(ground.find_contradiction(18.1)) == "F9d"
