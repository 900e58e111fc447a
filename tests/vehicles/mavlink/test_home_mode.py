"""A Paparazzi that was carried beyond the radius of its flight plan flies HOME by itself and obeys no Land: what is
said of it, and what never is."""

from dataclasses import replace

import pytest

from app.autopilots.dialects import Message, number
from app.autopilots.paparazzi.simulated import Paparazzi
from app.autopilots.paparazzi.simulated_telemetry import HOME, NAV
from app.autopilots.simulated.body import Body, Make, OutgoingMessage, SimulatedAutopilot
from app.vehicles.base import FlightOptions, FlightRecord, SafeGainsError, VehicleError
from app.vehicles.mavlink.transports import Peer
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from tests.vehicles.flying import SAFE, TUNED, never, unwatched
from tests.vehicles.mavlink.rigs import LockstepRig
from tests.vehicles.mavlink.test_connected import connected

ADVICE = "fly it manually, or stop its motors"
LAND_HERE = 13


def old_plan(*, max_distance_m: float = 5.5, sends_mode: bool = False) -> Make:
    """Its HOME mode begins right behind the radius of a trial, while it lands."""

    def make(body: Body, system: int) -> SimulatedAutopilot:
        return Paparazzi(body, system=system, max_distance_m=max_distance_m, sends_mode=sends_mode)

    return make


class Flickering(Paparazzi):
    """Every other heartbeat shows a pilot's mode, which a real pilot would not cause."""

    first = 0
    _beats = 0

    def tick(self) -> list[OutgoingMessage]:
        return [self._flickered(letter) for letter in super().tick()]

    def _flickered(self, letter: OutgoingMessage) -> OutgoingMessage:
        if letter.kind != "HEARTBEAT":
            return letter
        self._beats += 1
        by_hand = self.armed and (self._beats + self.first) % 2
        return replace(letter, fields={**letter.fields, "base_mode": 80 | 128}) if by_hand else letter


class FlickeringOtherwise(Flickering):
    first = 1


@pytest.mark.parametrize("kind", [Flickering, FlickeringOtherwise])
@pytest.mark.complete
def test_one_heartbeat_of_a_pilot_keeps_no_quarantined_vehicle_from_being_told_to_land_on(
    kind: type[Flickering],
) -> None:
    """Whichever of the two was the last one before the quarantine."""

    def make(body: Body, system: int) -> SimulatedAutopilot:
        return kind(body, system=system, max_distance_m=5.5)

    with LockstepRig(make=make, faults=["carried-away:5@8"]) as rig, connected(rig) as vehicle:
        assert "It has not landed within 40 s." in fly(vehicle).reason
        over_s = rig.now_s()
        vehicle.attend(20.0)
        assert lands(rig, over_s) >= 3


def fly(vehicle: MavlinkVehicle) -> FlightRecord:
    vehicle.stage(TUNED)
    return vehicle.fly(FlightOptions(seed=1, window_s=16.0), on_sample=unwatched, should_stop=never)


def is_land(message: Message) -> bool:
    return message.get_type() == "SCRIPT_ITEM" and number(message, "seq") == LAND_HERE


def lands(rig: LockstepRig, since_s: float) -> int:
    return sum(at_s > since_s and is_land(message) for at_s, message in rig.heard)


class Watching(LockstepRig):
    """Notes what is shown as the vehicle's trouble, with the time."""

    vehicle_now: MavlinkVehicle | None = None

    def read(self, timeout_s: float) -> list[tuple[bytes, Peer]]:
        if self.vehicle_now is not None:
            self.shown.append((self.now_s(), self.vehicle_now.condition().trouble))
        return super().read(timeout_s)

    def watch(self, vehicle: MavlinkVehicle) -> None:
        self.shown: list[tuple[float, str]] = []
        self.vehicle_now = vehicle


@pytest.mark.complete
def test_one_that_flies_home_is_quarantined_told_to_land_on_and_never_said_to_have_landed() -> None:
    """The operator is told before the landing is given up; once a pilot has set its mode it lands."""
    with Watching(make=old_plan(), faults=["carried-away:5@8"]) as rig, connected(rig) as vehicle:
        rig.watch(vehicle)
        record = fly(vehicle)
        assert (record.ending, rig.drone.autopilot.parameters["aut_mod"]) == ("aborted", HOME)
        assert "It has not landed within 40 s." in record.reason
        assert "Land was still being repeated when this record ended." in record.reason
        assert ADVICE in vehicle.concern
        landed_s = next(at_s for at_s, each in rig.heard if is_land(each))
        warned_s = next(at_s for at_s, trouble in rig.shown if ADVICE in trouble)
        assert 4.9 < warned_s - landed_s < 15.0

        over_s = rig.now_s()
        vehicle.attend(20.0)
        assert lands(rig, over_s) >= 3
        assert ADVICE in vehicle.condition().trouble
        with pytest.raises(SafeGainsError, match="Nothing is written"):
            vehicle.stage(SAFE)
        with pytest.raises(VehicleError, match="armed"):
            vehicle.release()

        rig.drone.autopilot._set_mode(NAV)  # type: ignore[attr-defined]
        vehicle.attend(30.0)
        assert rig.drone.body.altitude_m < 0.1
        assert vehicle.condition().trouble == ""
        vehicle.motors_off("it stands")
        vehicle.attend(2.0)
        vehicle.release()
        assert vehicle.concern == ""


@pytest.mark.complete
def test_a_landing_that_is_obeyed_is_no_trouble() -> None:
    with Watching() as rig, connected(rig) as vehicle:
        rig.watch(vehicle)
        assert fly(vehicle).ending == "completed"
        assert {trouble for _, trouble in rig.shown} == {""}


@pytest.mark.complete
def test_a_heartbeat_in_home_mode_is_a_separate_finding() -> None:
    make = old_plan(max_distance_m=4.0, sends_mode=True)
    with LockstepRig(make=make, faults=["carried-away:3@8"]) as rig, connected(rig) as vehicle:
        record = fly(vehicle)
        assert (record.ending, record.end.failure) == ("invalid", "F10b")
        assert vehicle.condition().mode == "Home"


@pytest.mark.parametrize(("away_m", "passes"), [(0.0, True), (2.9, True), (-3.1, False)])
def test_it_is_not_flown_so_far_from_home_that_its_plan_would_act_before_the_trials_radius(
    away_m: float, passes: bool
) -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        assert [each.name for each in vehicle.check() if not each.passed] == []
        rig.drone.body.north_m = away_m
        [item] = [each for each in vehicle.check() if each.name == "home"]
        assert item.passed is passes
        assert (item.found, item.needed) == (
            f"{abs(away_m):.1f} m, plus the 5 m that it may move from its start",
            "8 m or less in total: beyond it the flight plan lands it",
        )


def test_the_distance_from_home_is_asked_of_paparazzi_alone() -> None:
    with LockstepRig("px4") as rig:
        rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            assert "home" not in {each.name for each in vehicle.check()}
