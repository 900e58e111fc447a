from itertools import pairwise

import pytest

from app.autopilots.measurements import Position
from app.vehicles.mavlink.monitors.ground import ClimbMonitor, GroundMonitor
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


def climbed(*positions: Position) -> ClimbMonitor:
    climb = ClimbMonitor(highest_m=positions[0].altitude_m)
    for last, position in pairwise(positions):
        climb = climb.update(last, position)
    return climb


def test_an_altitude_that_stays_while_the_vehicle_climbs_falls_behind_its_climb_rate() -> None:
    """1 m/s for 0.6 s."""
    climb = climbed(*(Position(10.0 + 0.1 * count, 0.1, 1.0) for count in range(7)))
    assert climb.behind_m == pytest.approx(0.6)
    assert failure_of(climb.find_behind()) == "F9d"


def test_a_vehicle_that_was_above_the_ground_is_not_behind_any_more() -> None:
    lifted = ClimbMonitor().settle(0.1, airborne=True)
    assert lifted.update(Position(10.0, 0.1, 1.0), Position(11.0, 0.1, 1.0)).behind_m == 0.0


def test_a_gap_leaves_unseen_how_high_it_went_until_it_is_seen_above_the_ground() -> None:
    """2 m/s up for 0.6 s."""
    climb = climbed(Position(10.0, 0.1, 2.0), Position(10.6, 0.1, 0.0))
    assert climb.unseen_m == pytest.approx(1.3)
    assert climb.settle(0.1, airborne=False).unseen_m == pytest.approx(1.3)
    assert climb.settle(0.1, airborne=True).unseen_m is None


def test_a_record_ends_sunken_below_half_of_the_lowest_set_point_unless_it_swings() -> None:
    climb = climbed(Position(10.0, 3.0, 0.0))
    assert climb.find_sunken(Position(20.0, 1.4, 0.0), 3.0, 0.1) is not None
    assert climb.find_sunken(Position(20.0, 1.6, 0.0), 3.0, 0.1) is None
    assert climb.find_sunken(Position(20.0, 1.4, 0.4), 3.0, 0.1) is None
