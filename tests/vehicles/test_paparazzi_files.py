"""The files that a Paparazzi is built with (docs/paparazzi) have what this program relies on."""

import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from app.autopilots.paparazzi import simulated_plan as simulated
from app.autopilots.paparazzi.profile import BLOCKS, LAND, PAPARAZZI, TAKE_OFF
from app.vehicles.mavlink.preflight import POSITIONS_HZ
from app.vehicles.mavlink_kind import MAVLINK
from app.vehicles.simulated import FLIGHT_S

DOCS = Path(__file__).parents[2] / "docs"
FOLDER = DOCS / "paparazzi"
OVERSHOOT_M = 10.0
"""How far the real autopilot flew on in its simulation when an exception of place landed it at 6 m/s: 7 … 10 m."""


@pytest.fixture(scope="module")
def flight_plan() -> ElementTree.Element:
    return ElementTree.parse(FOLDER / "gainline_takeoff.xml").getroot()


@pytest.fixture(scope="module")
def periods_s() -> dict[str, float]:
    """Of the messages that Paparazzi sends over MAVLink."""
    telemetry = ElementTree.parse(FOLDER / "gainline_telemetry.xml").getroot()
    messages = telemetry.iterfind("process[@name='Mavlink']/mode[@name='default']/message")
    return {message.attrib["name"]: float(message.attrib["period"]) for message in messages}


def block(flight_plan: ElementTree.Element, name: str) -> ElementTree.Element:
    [found] = [each for each in flight_plan.iterfind("blocks/block") if each.attrib["name"] == name]
    return found


def test_the_plan_has_every_block_that_a_trial_asks_for_or_passes_through(flight_plan: ElementTree.Element) -> None:
    names = [each.attrib["name"] for each in flight_plan.iterfind("blocks/block")]
    assert len(set(names)) == len(names)
    assert set(BLOCKS) <= set(names)
    after = names[names.index(LAND) :]
    assert after[-1] == "landed"
    assert PAPARAZZI.landing_blocks >= set(after)
    for each in flight_plan.iter("exception"):
        assert each.attrib["deroute"] in names


def test_the_plan_brings_the_vehicle_down_by_itself_but_never_within_a_trial(flight_plan: ElementTree.Element) -> None:
    takeoff = block(flight_plan, TAKE_OFF)
    assert {each.attrib["cond"]: each.attrib["deroute"] for each in takeoff.iterfind("exception")} == {
        "block_time > 45": LAND,
        "stateGetPositionEnu_f()->z > 4.5": LAND,
        "stateGetPositionEnu_f()->x > 8": LAND,
        "0 > stateGetPositionEnu_f()->x + 8": LAND,
        "stateGetPositionEnu_f()->y > 8": LAND,
        "0 > stateGetPositionEnu_f()->y + 8": LAND,
    }
    assert FLIGHT_S < 45.0
    simulation = next(each for each in simulated.BLOCKS if each.name == TAKE_OFF)
    assert (simulation.max_time_s, simulation.max_height_m, simulation.max_distance_m) == (45.0, 4.5, 8.0)


def test_the_trials_radius_and_the_plans_exceptions_act_long_before_its_home_mode(
    flight_plan: ElementTree.Element,
) -> None:
    [home] = [each for each in flight_plan.iterfind("waypoints/waypoint") if each.attrib["name"] == "HOME"]
    farthest_m, home_m = float(flight_plan.attrib["max_dist_from_home"]), float(home.attrib["height"])
    assert (farthest_m, home_m) == (simulated.MAX_DISTANCE_M, simulated.HOME_HEIGHT_M)
    assert "home_mode_height" not in flight_plan.attrib, "it does nothing on a rotorcraft"
    assert home_m > float(flight_plan.attrib["security_height"])
    limit_m = next(each for each in simulated.BLOCKS if each.name == TAKE_OFF).max_distance_m
    options = MAVLINK.check({}, field="options")
    assert float(options["radius_m"]) < limit_m == options["plan_radius_m"]
    corner_m = limit_m * 2.0**0.5
    assert corner_m + OVERSHOOT_M < farthest_m / 2.0
    assert (float(home.attrib["x"]), float(home.attrib["y"])) == (0.0, 0.0)


def test_takeoff_is_a_step_of_altitude_to_the_waypoint_that_is_moved(flight_plan: ElementTree.Element) -> None:
    stay = block(flight_plan, TAKE_OFF).find("stay")
    assert stay is not None
    assert stay.attrib == {"wp": "CLIMB", "vmode": "alt"}
    names = ["", *(each.attrib["name"] for each in flight_plan.iterfind("waypoints/waypoint"))]
    [option] = [each for each in MAVLINK.options if each.name == "climb_waypoint"]
    assert names.index("CLIMB") == option.default


def test_from_landing_on_the_plan_never_climbs_and_ends_without_thrust(flight_plan: ElementTree.Element) -> None:
    names = [each.attrib["name"] for each in flight_plan.iterfind("blocks/block")]
    for name, following in pairwise(names[names.index(LAND) :]):
        parts = block(flight_plan, name)
        assert [float(each.attrib["climb"]) for each in parts.iterfind("stay")] in ([], [-simulated.DESCENT_M_S])
        assert following in PAPARAZZI.landing_blocks
    [idle] = block(flight_plan, "landed")
    assert (idle.attrib["throttle"], idle.attrib["vmode"], idle.attrib["until"]) == ("0", "throttle", "FALSE")


def test_the_airframe_defines_where_the_drone_sends_to() -> None:
    """Seen: as <configure>, which only sets a variable of the Makefile, the address never reached the compiler, and the
    drone sent to itself; in the simulator that is the right place."""
    module = re.search(r"<module name=\"mavlink\">.*?</module>", (DOCS / "real-flight.md").read_text(), re.DOTALL)
    assert module is not None
    parts = ElementTree.fromstring(module.group())
    defined = {each.attrib["name"]: each.attrib["value"] for each in parts.iterfind("define")}
    assert {name for name in defined if name.startswith("UDP1_")} == {"UDP1_HOST", "UDP1_PORT_OUT", "UDP1_PORT_IN"}
    assert {each.attrib["name"] for each in parts.iterfind("configure")} == {"MAVLINK_PORT"}
    address = str(MAVLINK.check({}, field="options")["address"])
    assert address.endswith(f":{defined['UDP1_PORT_IN']}@{defined['UDP1_PORT_OUT']}")


def test_telemetry_comes_as_often_as_a_trial_needs_it(periods_s: dict[str, float]) -> None:
    assert periods_s["LOCAL_POSITION_NED"] == 0.02
    assert 1.0 / periods_s["LOCAL_POSITION_NED"] > POSITIONS_HZ
    assert periods_s["HEARTBEAT"] <= PAPARAZZI.heartbeat_s
    assert periods_s["SYS_STATUS"] <= 1.0
    assert "AUTOPILOT_VERSION" in periods_s
