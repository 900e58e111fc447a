"""Motors off, and Land in the first seconds of a flight."""

import re
from contextlib import closing

import pytest

from app.autopilots.dialects import number
from app.autopilots.paparazzi.simulated import Paparazzi
from app.autopilots.paparazzi.simulated_plan import KILL_SETTING, LANDED_AFTER_S, NEWER_KILL_SETTING
from app.autopilots.simulated.body import Body, Make, SimulatedAutopilot
from app.vehicles.base import (
    FlightOptions,
    FlightRecord,
    InterruptedByOrderError,
    SafeGainsError,
    VehicleError,
)
from app.vehicles.flight_end import Landing, StopRequest
from app.vehicles.mavlink.transports import Peer
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from tests.vehicles.flying import SAFE, TUNED, Watcher, never, unwatched
from tests.vehicles.mavlink.rigs import LockstepRig
from tests.vehicles.mavlink.test_connected import connected

ORDER = FlightOptions(seed=1, window_s=12.0)
HARD_M_S = 2.0
MESSAGE_ID, PARAM_SET, COMMAND_LONG = 5, 23, 76
"""Where a frame of MAVLink 1 has the number of its message, and two of these."""


class DeafToCommands(Paparazzi):
    """Answers no COMMAND_LONG."""

    deaf_to = frozenset({COMMAND_LONG})

    def receive(self, data: bytes) -> None:
        if data[MESSAGE_ID] not in self.deaf_to:
            super().receive(data)


def of(kind: type[Paparazzi] = Paparazzi, **how: str | float) -> Make:
    def make(body: Body, system: int) -> SimulatedAutopilot:
        return kind(body, system=system, **how)  # type: ignore[arg-type]

    return make


class FallingRig(LockstepRig):
    """`impact_m_s`: the fastest that the vehicle truly sank within half a metre of the ground."""

    impact_m_s = 0.0

    def tick(self) -> None:
        super().tick()
        if 0.0 < self.drone.body.altitude_m < 0.5:
            self.impact_m_s = max(self.impact_m_s, -self.drone.body.climb_rate_m_s)


def fly(vehicle: MavlinkVehicle) -> FlightRecord:
    vehicle.stage(TUNED)
    return vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)


@pytest.mark.complete
@pytest.mark.parametrize("setting", [NEWER_KILL_SETTING, ""])
def test_after_a_flight_the_motors_stand_whatever_another_release_calls_its_setting(setting: str) -> None:
    with LockstepRig(make=of(kill_setting=setting)) as rig, connected(rig) as vehicle:
        assert all(item.passed for item in vehicle.check())
        record = fly(vehicle)
        assert (record.ending, vehicle.concern, rig.drone.autopilot.armed) == ("completed", "", False)
        assert vehicle.read_gains() == SAFE


@pytest.mark.parametrize("setting", [KILL_SETTING, pytest.param(NEWER_KILL_SETTING, marks=pytest.mark.complete)])
def test_a_vehicle_that_ignores_commands_is_stopped_by_its_setting(setting: str) -> None:
    with LockstepRig(make=of(DeafToCommands, kill_setting=setting)) as rig, connected(rig) as vehicle:
        record = fly(vehicle)
        assert (record.ending, vehicle.concern, rig.drone.autopilot.armed) == ("completed", "", False)


def test_a_vehicle_that_confirms_no_way_to_stop_its_motors_is_not_flown() -> None:
    with LockstepRig(make=of(DeafToCommands, kill_setting="")) as rig, connected(rig) as vehicle:
        [stopping] = [item for item in vehicle.check() if item.name == "motors_off"]
        assert (stopping.passed, stopping.found) == (
            False,
            "the vehicle did not confirm any command that stops its motors",
        )
        vehicle.stage(TUNED)
        with pytest.raises(VehicleError, match="Motors off: the vehicle did not confirm any command"):
            vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)
        assert not rig.drone.autopilot.took_off


def test_the_command_is_tried_only_on_a_vehicle_that_stands_disarmed() -> None:
    with LockstepRig(make=of(kill_setting="")) as rig, connected(rig) as vehicle:
        assert not rig.told("COMMAND_LONG")
        vehicle.check()
        assert [number(message, "param1") for message in rig.told("COMMAND_LONG")] == [0.0]
    with LockstepRig(make=of(kill_setting="")) as rig, connected(rig) as vehicle:
        rig.drone.autopilot._enter(3)  # type: ignore[attr-defined]  # armed by somebody else
        vehicle.check()
        assert not rig.told("COMMAND_LONG")


@pytest.mark.complete
@pytest.mark.parametrize("setting", [KILL_SETTING, NEWER_KILL_SETTING, ""])
def test_motors_off_in_the_air_stops_them_and_is_said_to_have_when_the_vehicle_says_so(setting: str) -> None:
    with LockstepRig(make=of(kill_setting=setting)) as rig, connected(rig) as vehicle:
        vehicle.stage(TUNED)

        def slide() -> StopRequest | None:
            return StopRequest("people below", motors_off=True) if rig.drone.body.altitude_m > 1.0 else None

        record = vehicle.fly(ORDER, on_sample=unwatched, should_stop=slide)
        assert (rig.drone.autopilot.armed, vehicle.has_stopped) == (False, True)
        assert record.end.request == StopRequest("people below", motors_off=True)
        stopped, height = record.end.remarks
        assert stopped == "The vehicle confirmed that its motors have stopped."
        assert re.fullmatch("The vehicle was 1.[0-9] m above the ground: inspect it before it flies again.", height)


@pytest.mark.complete
def test_motors_off_that_the_vehicle_ignores_is_not_reported_as_done() -> None:
    """Seen: recorded as stopped, while the drone hovered on."""
    slid: list[float] = []

    class Heedless(DeafToCommands):
        def receive(self, data: bytes) -> None:
            if not (slid and data[MESSAGE_ID] == PARAM_SET):
                super().receive(data)

    with LockstepRig(make=of(Heedless)) as rig, connected(rig) as vehicle:
        vehicle.stage(TUNED)

        def slide() -> StopRequest | None:
            if rig.drone.body.altitude_m > 1.0:
                slid.append(rig.now_s())
            return StopRequest("people below", motors_off=True) if slid else None

        record = vehicle.fly(ORDER, on_sample=unwatched, should_stop=slide)
        assert record.end.request == StopRequest("people below", motors_off=True)
        assert "It has not confirmed within 5 s that its motors stopped." in record.end.remarks
        assert (vehicle.concern != "", vehicle.has_stopped) == (True, False)
        vehicle.attend(40.0)  # and it is told to land on
        assert rig.drone.body.altitude_m < 0.1


@pytest.mark.complete
@pytest.mark.parametrize("tenths", range(1, 31, 4))
def test_an_abort_in_the_first_seconds_brings_it_down_gently(tenths: int) -> None:
    with FallingRig(make=of(landed_after_s=LANDED_AFTER_S)) as rig, connected(rig) as vehicle:
        record = aborted(vehicle, tenths / 10)
        assert (record.ending, vehicle.concern) == ("aborted", "")
        assert rig.impact_m_s < 1.2


@pytest.mark.parametrize(
    ("at_s", "falls"),
    [
        (0.7, True),
        pytest.param(0.9, True, marks=pytest.mark.complete),
        *(pytest.param(at_s, False, marks=pytest.mark.complete) for at_s in (0.1, 0.5, 1.3, 1.7, 2.1, 2.5, 2.9)),
    ],
)
def test_under_the_plan_of_before_a_fall_is_noticed_and_recorded(at_s: float, falls: bool) -> None:
    """As it has just lifted off, before it counts as flying."""
    with FallingRig(make=of(landed_after_s=0.0)) as rig, connected(rig) as vehicle:
        record = aborted(vehicle, at_s)
        assert record.ending == "aborted"
        assert (rig.impact_m_s > HARD_M_S, record.end.landed is Landing.FELL) == (falls, falls)
        assert bool(vehicle.concern) == falls
        if falls:
            with pytest.raises(SafeGainsError, match=re.escape(record.end.remarks[0])):
                vehicle.stage(TUNED)


def aborted(vehicle: MavlinkVehicle, at_s: float) -> FlightRecord:
    watcher = Watcher(abort_at_s=at_s)
    vehicle.stage(TUNED)
    return vehicle.fly(ORDER, on_sample=watcher.see, should_stop=watcher.decide)


class StallingRig(LockstepRig):
    """The program stands still for five seconds as it listens for the first time to the armed vehicle."""

    stalled = False

    def read(self, timeout_s: float) -> list[tuple[bytes, Peer]]:
        if self.drone.autopilot.armed and not self.stalled:
            self.stalled = True
            self.wait_s(5.0)
        return super().read(timeout_s)


def test_a_program_that_stood_still_while_it_armed_commands_no_take_off() -> None:
    """Seen: it went through what had come meanwhile, took off five seconds late, and read the abort then."""
    with StallingRig() as rig, connected(rig) as vehicle:
        vehicle.stage(TUNED)
        with pytest.raises(VehicleError) as failed:
            vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)
        assert failed.value.not_flown
        assert rig.stalled
        assert not rig.drone.autopilot.took_off
        assert (vehicle.concern, vehicle.read_gains()) == ("", SAFE)


@pytest.mark.complete
def test_the_text_of_a_stall_while_it_arms() -> None:
    said = "Gainline stalled for 5 s, so the takeoff was not commanded"
    with StallingRig() as rig, connected(rig) as vehicle, pytest.raises(VehicleError, match=said):
        fly(vehicle)


def test_giving_back_the_safe_gains_goes_to_its_end_though_an_order_comes() -> None:
    """Seen: the vehicle kept the trial's gains, and was quarantined, when Land was ordered in these two seconds."""
    with LockstepRig() as rig:
        waits: list[float] = []

        def order() -> None:
            if waits:
                raise InterruptedByOrderError("It was interrupted: land was ordered.", hint="")

        with closing(
            MavlinkVehicle(rig.options(), SAFE, is_real=False, clock=rig, transport=rig, on_wait=order)
        ) as vehicle:
            vehicle.stage(TUNED)

            def refuse() -> StopRequest | None:
                waits.append(rig.now_s())
                return StopRequest("not now")

            vehicle.fly(ORDER, on_sample=unwatched, should_stop=refuse)
            assert waits
            waits.clear()
            assert (vehicle.concern, vehicle.read_gains()) == ("", SAFE)
