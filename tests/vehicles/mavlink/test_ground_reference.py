"""The ground reference of a Paparazzi: its flight plan sets it in "Geo init", unless that block is ended before."""

import math

import pytest

from app.autopilots.dialects import FieldValue
from app.autopilots.paparazzi.simulated import Paparazzi
from app.autopilots.registry import AUTOPILOTS
from app.autopilots.simulated.body import OutgoingMessage
from app.vehicles.base import CheckItem, SafeGainsError
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from tests.vehicles.flying import TUNED, never, unwatched
from tests.vehicles.mavlink.rigs import LockstepRig
from tests.vehicles.mavlink.test_connected import blocks_told, connected
from tests.vehicles.mavlink.test_vehicle import ORDER

WAIT_GPS, HOLDING, LANDED = 0, 2, 16
PLAN_S, PLACE_MM, PLAN_MM = 10.0, 147_095, 146_000


def late() -> LockstepRig:
    """Its plan has set the reference before anybody listened."""
    rig = LockstepRig()
    rig.muted = True
    rig.wait_s(12.0)
    rig.muted = False
    return rig


def autopilot_of(rig: LockstepRig) -> Paparazzi:
    assert isinstance(rig.drone.autopilot, Paparazzi)
    return rig.drone.autopilot


def enter(rig: LockstepRig, block: int) -> None:
    """As another ground station does."""
    codec = AUTOPILOTS["paparazzi"].dialect.codec(system=254, component=1)
    fields: dict[str, FieldValue] = {"target_system": 31, "target_component": 0, "seq": block, "name": ""}
    rig.drone.receive(codec.pack(AUTOPILOTS["paparazzi"].dialect.message("SCRIPT_ITEM", fields)))


def reference(vehicle: MavlinkVehicle) -> CheckItem:
    [item] = [item for item in vehicle.check() if item.name == "ground_reference"]
    return item


def test_a_plan_that_is_heard_from_the_start_is_only_waited_for() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        item = reference(vehicle)
        assert (item.passed, item.found, blocks_told(rig)) == (True, "it stands at 0.10 m", [])
        assert 12.0 < rig.now_s() < 15.0


@pytest.mark.complete
def test_a_plan_that_was_not_heard_sets_the_reference_again_and_once() -> None:
    with late() as rig, connected(rig) as vehicle:
        rig.drone.body.north_m = 1.0
        begun_s = rig.now_s()
        assert reference(vehicle).passed
        assert rig.now_s() - begun_s == pytest.approx(PLAN_S + 4.2, abs=0.4), "observed for 2 s before it and after it"
        assert (blocks_told(rig), autopilot_of(rig).north_m) == ([WAIT_GPS], 0.0)
        assert reference(vehicle).passed
        assert blocks_told(rig) == [WAIT_GPS]


def test_a_plan_that_another_station_hurries_sets_the_reference_again() -> None:
    """The real one scored 0.272 and 0.283 m in place of 0.325."""
    with LockstepRig() as rig, connected(rig) as vehicle:
        enter(rig, HOLDING)
        vehicle.attend(0.3)
        assert autopilot_of(rig).origin_mm == PLAN_MM
        assert reference(vehicle).passed
        assert (blocks_told(rig), autopilot_of(rig).origin_mm) == ([WAIT_GPS], PLACE_MM)


@pytest.mark.complete
def test_a_plan_whose_report_was_lost_is_begun_again() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.attend(1.0)
        rig.muted = True
        rig.wait_s(10.0)
        rig.muted = False
        vehicle.attend(2.0)
        assert reference(vehicle).passed
        assert blocks_told(rig) == [WAIT_GPS]


@pytest.mark.complete
def test_a_restarted_vehicle_sets_it_again() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        assert reference(vehicle).passed
        rig.drone.reboot()
        vehicle.attend(4.0)
        assert not vehicle._radio.seen.has_ground_reference
        enter(rig, LANDED)
        assert reference(vehicle).passed
        assert (blocks_told(rig), autopilot_of(rig).origin_mm) == ([WAIT_GPS], PLACE_MM)


@pytest.mark.complete
def test_a_vehicle_that_stands_elsewhere_sets_it_again() -> None:
    """Switched on in the hand, say, and put down."""
    with LockstepRig() as rig, connected(rig) as vehicle:
        assert reference(vehicle).passed
        autopilot_of(rig).origin_mm += 500
        assert reference(vehicle).passed
        assert (blocks_told(rig), autopilot_of(rig).origin_mm) == ([WAIT_GPS], PLACE_MM)


def test_without_a_position_it_is_not_flown() -> None:
    with LockstepRig() as rig:
        autopilot_of(rig).position_after_s = math.inf
        with connected(rig) as vehicle:
            item = reference(vehicle)
            assert (item.passed, item.found) == (
                False,
                "not set by the flight plan (mode Automatic, block not reported)",
            )
            assert "until it has a position" in item.hint
            assert blocks_told(rig) == [WAIT_GPS]


@pytest.mark.complete
def test_a_stranger_who_reports_the_last_block_over_and_over_does_not_hold_the_check_up() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        autopilot_of(rig).position_after_s = math.inf
        report, tick = OutgoingMessage("SCRIPT_CURRENT", {"seq": HOLDING}, "mission"), rig.drone.autopilot.tick
        rig.drone.autopilot.tick = lambda: [*tick(), report]  # type: ignore[method-assign]
        begun_s = rig.now_s()
        assert not reference(vehicle).passed
        assert rig.now_s() - begun_s < 3 * 16.0


def test_a_vehicle_that_may_only_be_observed_is_not_told_to() -> None:
    with late() as rig, connected(rig) as vehicle:
        vehicle._observe("Somebody else armed it.")
        assert not reference(vehicle).passed
        assert blocks_told(rig) == []


@pytest.mark.complete
def test_after_a_reboot_in_the_air_and_its_landing_it_is_set_before_the_next_flight() -> None:
    with LockstepRig(faults=["reboot@3"]) as rig, connected(rig) as vehicle:
        vehicle.stage(TUNED)
        vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)
        with pytest.raises(SafeGainsError):
            vehicle.stage(TUNED)
        vehicle.land("to be sure")
        vehicle.attend(20.0)
        assert autopilot_of(rig).origin_mm == PLAN_MM, "Land ended “Geo init”"
        vehicle.release()
        assert reference(vehicle).passed
        assert autopilot_of(rig).origin_mm == PLACE_MM
