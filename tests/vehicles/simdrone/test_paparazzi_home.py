"""What a Paparazzi does that is farther from HOME than its flight plan allows: its HOME mode obeys no block."""

import pytest

from app.autopilots.paparazzi.simulated import Paparazzi
from app.autopilots.paparazzi.simulated_plan import HOME_HEIGHT_M
from app.autopilots.paparazzi.simulated_telemetry import HOME, NAV
from app.autopilots.simulated.body import Body
from tests.simdrone.ground import Ground, flying
from tests.simdrone.paparazzi import ARMED, LAND, LAND_HERE, Pilot, from_vehicle

TUNED = (1624, 1356, 195)
NEAR_M = 6.0


def built(body: Body, system: int) -> Paparazzi:
    """With a plan that allows less than a real one, so that wind carries it there within its takeoff."""
    return Paparazzi(body, system=system, max_distance_m=NEAR_M)


def away_m(ground: Ground) -> float:
    ground.listen(0.03)
    return abs(float(ground.expect("LOCAL_POSITION_NED").x))


@pytest.fixture
def lost() -> Pilot:
    """Just carried out of its radius while it hovered."""
    pilot = Pilot(flying("paparazzi", make=built, faults=["carried-away:4@6"]))
    pilot.set_gains(*TUNED)
    pilot.take_off()
    pilot.ground.expect("LOCAL_POSITION_NED", lambda message: abs(message.x) > NEAR_M, within_s=12.0)
    return pilot


def test_wind_carries_it_over_the_ground_and_it_says_where_it_is() -> None:
    ground = flying("paparazzi", faults=["carried-away:1@6"])
    Pilot(ground).take_off()
    before, heard = (from_vehicle(ground.listen(each_s), "LOCAL_POSITION_NED") for each_s in (5.5, 3.5))
    assert {each.x for each in before} == {0.0}
    assert heard[-1].x == pytest.approx(2.0, abs=0.1)
    assert max(each.vx for each in heard) == pytest.approx(2.0, abs=0.1)


@pytest.mark.complete
def test_too_far_from_home_it_flies_back_at_its_height_of_home_and_obeys_no_block(lost: Pilot) -> None:
    for _ in range(3):
        lost.block(LAND_HERE)
        heard = lost.ground.listen(5.0)
        assert LAND not in [each.seq for each in from_vehicle(heard, "SCRIPT_CURRENT")]
    assert away_m(lost.ground) < 0.5
    assert -lost.position().z == pytest.approx(HOME_HEIGHT_M, abs=0.2)
    assert lost.is_armed()


@pytest.mark.complete
def test_its_mode_stays_home_inside_the_radius_until_it_is_set_again(lost: Pilot) -> None:
    lost.ground.listen(10.0)
    answer = lost.read("aut_mod")
    assert answer is not None
    assert answer.param_value == HOME
    lost.block(LAND_HERE)
    assert lost.ground.wait_for("SCRIPT_CURRENT", lambda message: message.seq == LAND, within_s=3.0) is None
    lost.set("aut_mod", NAV)
    lost.block(LAND_HERE)
    lost.ground.expect("SCRIPT_CURRENT", lambda message: message.seq >= LAND)


def test_out_there_setting_its_mode_lasts_no_longer_than_a_look(lost: Pilot) -> None:
    lost.ground.listen(0.1)
    lost.set("aut_mod", NAV)
    lost.ground.listen(0.1)
    answer = lost.read("aut_mod")
    assert answer is not None
    assert answer.param_value == HOME


@pytest.mark.parametrize("how", ["command", "setting"])
def test_its_motors_can_be_stopped_all_the_same(how: str, lost: Pilot) -> None:
    assert lost.command(400, 0.0) == 0 if how == "command" else lost.set("kil_thr", 1.0) == 1.0
    assert not lost.is_armed()


@pytest.mark.parametrize(("tells", "number"), [(False, 0), (True, HOME)])
def test_its_heartbeat_looks_like_nav_unless_its_release_tells_the_modes_number(tells: bool, number: int) -> None:
    def make(body: Body, system: int) -> Paparazzi:
        return Paparazzi(body, system=system, max_distance_m=NEAR_M, sends_mode=tells)

    pilot = Pilot(flying("paparazzi", make=make, faults=["carried-away:4@6"]))
    pilot.take_off()
    pilot.ground.expect("LOCAL_POSITION_NED", lambda message: abs(message.x) > NEAR_M, within_s=12.0)
    pilot.ground.listen(0.6)
    beat = pilot.ground.expect("HEARTBEAT")
    assert (beat.base_mode, beat.custom_mode) == (ARMED | 4, number)


@pytest.mark.complete
def test_the_plan_lands_it_before_that() -> None:
    """At the distance of the delivered plan, without a ground station on the link."""
    ground = flying("paparazzi", faults=["carried-away:6@6"])
    Pilot(ground).take_off()
    assert ground.expect("SCRIPT_CURRENT", lambda message: message.seq in (LAND_HERE, LAND), within_s=20.0)
    heard = from_vehicle(ground.listen(25.0), "LOCAL_POSITION_NED")
    assert 8.0 < abs(heard[-1].x) < 20.0
    assert -heard[-1].z < 0.2
