"""A vehicle that the process that flew it left in the air, and the next process that finds it there."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from typing import Final

import pytest

from app.autopilots.commands import Action, Target
from app.autopilots.registry import AUTOPILOTS
from app.vehicles.base import FlightOptions, Identity
from app.vehicles.flight_end import StopRequest
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from tests.vehicles.flying import unwatched
from tests.vehicles.mavlink.rigs import SAFE, LockstepRig, copter_of
from tests.vehicles.mavlink.test_connected import LAND_HERE, START_ENGINE, TAKE_OFF, blocks_told, enter_block

LESS_OFTEN: Final = ["ardupilot", *(pytest.param(each, marks=pytest.mark.complete) for each in ("paparazzi", "px4"))]
"""The everyday ring flies one of them."""
SYSTEMS: Final = {"paparazzi": 31, "ardupilot": 1, "px4": 1}


@contextmanager
def left_in_the_air(autopilot: str) -> Iterator[LockstepRig]:
    """At 1.5 m or more, in the mode and block of a trial, after a ground station whose heartbeats have ended."""
    with LockstepRig(autopilot) as rig:
        if autopilot == "paparazzi":
            enter_block(rig, START_ENGINE, TAKE_OFF)
            rig.wait_s(4.0)
        else:
            rig.switch_on_failsafes()
            rig.wait_s(15.0)  # until its estimator is ready, and its plan has set the ground reference
            profile, target = AUTOPILOTS[autopilot], Target(system=1, aircraft=1)
            with closing(rig.link(target_system=1)) as link:
                for action in (Action.ARM, Action.TAKE_OFF):
                    for outgoing in (sent for step in profile.steps(action, target) for sent in step.sends):
                        link.receive(0.0)
                        link.send(outgoing.kind, **outgoing.fields)
                        rig.wait_s(1.0)
                for _ in range(70):
                    link.receive(0.0)
                    rig.wait_s(0.1)
        assert rig.drone.body.altitude_m > 1.5
        rig.heard.clear()
        yield rig


@contextmanager
def found(rig: LockstepRig, *, was_flying: bool = True, uid: str = "") -> Iterator[MavlinkVehicle]:
    vehicle = MavlinkVehicle(
        rig.options(),
        SAFE[rig.autopilot],
        is_real=False,
        clock=rig,
        transport=rig,
        identity=Identity(system_id=SYSTEMS[rig.autopilot], autopilot=rig.autopilot, version="", uid=uid),
        observes=True,
        was_flying=was_flying,
    )
    try:
        yield vehicle
    finally:
        vehicle.close()


def lands_told(rig: LockstepRig) -> int:
    """Commands to land: the block under Paparazzi, or the mode, 9 of ArduCopter and 4.6 of PX4."""
    modes = [(message.param2, message.param3) for message in rig.told("COMMAND_LONG") if message.command == 176]  # type: ignore[attr-defined]
    return blocks_told(rig).count(LAND_HERE) + modes.count((9.0, 0.0)) + modes.count((4.0, 6.0))


def stops_told(rig: LockstepRig) -> list[object]:
    return [message for message in rig.told("COMMAND_LONG") if message.command == 400]  # type: ignore[attr-defined]


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", LESS_OFTEN)
def test_a_vehicle_that_somebody_else_has_in_the_air_is_only_observed(autopilot: str) -> None:
    with left_in_the_air(autopilot) as rig, found(rig, was_flying=False) as vehicle:
        vehicle.attend(15.0)
        assert (lands_told(rig), vehicle.condition().step) == (0, "observing")
        assert rig.drone.body.altitude_m > 1.0


@pytest.mark.parametrize("autopilot", ["ardupilot", pytest.param("px4", marks=pytest.mark.complete)])
def test_a_pilots_mode_gets_no_land_and_goes_on_getting_heartbeats(autopilot: str) -> None:
    """A failsafe that lands it would take it from the pilot; handed back later, it is still not Gainline's."""
    with left_in_the_air(autopilot) as rig:
        copter_of(rig.drone).take_over()
        with found(rig) as vehicle:
            vehicle.attend(15.0)
            assert (lands_told(rig), vehicle.condition().trouble) == (0, "")
            assert len(rig.told("HEARTBEAT")) >= 10
            copter_of(rig.drone).hand_back()
            vehicle.attend(5.0)
            assert lands_told(rig) == 0


@pytest.mark.complete
def test_in_an_automatic_mode_that_is_not_the_trials_it_hears_nothing_until_its_own_failsafe_lands_it() -> None:
    """FS_GCS_TIMEOUT is 5 s; the last heartbeat was sent up to a second before it was left alone."""
    with left_in_the_air("ardupilot") as rig:
        copter = copter_of(rig.drone)
        copter.enter(copter.find_mode("BRAKE"))
        begun_s = rig.now_s()
        with found(rig) as vehicle:
            vehicle.attend(15.0)
            assert rig.drone.body.stands
            assert min(at_s for at_s, message in rig.heard if message.get_type() == "HEARTBEAT") - begun_s > 4.0


@pytest.mark.complete
@pytest.mark.parametrize(
    "uid",
    ["00112233", "0000000000000007"],
    ids=["another", "not reported"],
)
def test_a_vehicle_that_may_be_another_one_gets_no_land(uid: str) -> None:
    with left_in_the_air("px4") as rig:
        copter_of(rig.drone).uid = 1 if uid == "00112233" else 0
        with found(rig, uid=uid) as vehicle:
            vehicle.attend(5.0)
            assert (lands_told(rig), vehicle.condition().step) == (0, "observing")


def test_a_person_who_decides_ends_the_landing_that_no_person_asked_for() -> None:
    with left_in_the_air("paparazzi") as rig, found(rig) as vehicle:
        vehicle.motors_off("people below")
        told = lands_told(rig)
        vehicle.attend(5.0)
        assert lands_told(rig) == told
        assert "Motors off was requested: people below." in vehicle.concern


@pytest.mark.complete
def test_a_vehicle_that_has_landed_meanwhile_is_ready_and_hears_the_heartbeats_that_it_flies_with() -> None:
    def stop() -> StopRequest | None:
        return StopRequest("enough") if rig.drone.body.altitude_m > 1.0 else None

    with LockstepRig("ardupilot") as rig:
        rig.switch_on_failsafes()
        rig.wait_s(10.0)  # until its estimator is ready
        with found(rig) as vehicle:
            assert (vehicle.concern, vehicle.condition().held, lands_told(rig)) == ("", SAFE["ardupilot"], 0)
            vehicle.stage(SAFE["ardupilot"])
            rig.heard.clear()
            assert vehicle.fly(FlightOptions(seed=1, window_s=12.0), on_sample=unwatched, should_stop=stop).has_flown
            heartbeats_s = [at_s for at_s, message in rig.heard if message.get_type() == "HEARTBEAT"]
            assert len(heartbeats_s) > 5
            assert max(later_s - at_s for at_s, later_s in pairwise(heartbeats_s)) < 1.1
            rig.drone.autopilot._arm(force=True)  # type: ignore[attr-defined]  # by somebody else
            vehicle.attend(3.0)
            assert "The process that flew it" not in vehicle.concern
