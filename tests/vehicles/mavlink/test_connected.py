"""A vehicle whose link stays open between flights, against the simulated drone."""

import math
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from pymavlink import mavutil

from app.autopilots.dialects import number
from app.autopilots.registry import AUTOPILOTS
from app.vehicles.base import FlightOptions, Identity, SafeGainsError, Sample, VehicleError
from app.vehicles.flight_end import StopRequest
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from tests.vehicles.flying import SAFE, TUNED, Watcher, never, unwatched
from tests.vehicles.mavlink.rigs import SAFE as OWN_SAFE
from tests.vehicles.mavlink.rigs import LockstepRig

ORDER = FlightOptions(seed=1, window_s=12.0)
START_ENGINE, TAKE_OFF, LAND_HERE = 3, 4, 13
PINNED = Identity(system_id=31, autopilot="paparazzi", version="")


@contextmanager
def connected(
    rig: LockstepRig,
    identity: Identity | None = None,
    *,
    trial_parameters: Path | None = None,
    **options: bool | float | str,
) -> Iterator[MavlinkVehicle]:
    vehicle = MavlinkVehicle(
        rig.options(**options),
        OWN_SAFE[rig.autopilot],
        is_real=False,
        clock=rig,
        transport=rig,
        identity=identity,
        observes=True,
        trial_parameters=trial_parameters,
    )
    try:
        yield vehicle
    finally:
        vehicle.close()


def enter_block(rig: LockstepRig, *blocks: int) -> None:
    """As somebody else's ground station does."""
    with closing(rig.link(target_system=31)) as link:
        for block in blocks:
            link.send("MISSION_ACK", target_system=31, target_component=0, type=0)
            link.send("SCRIPT_ITEM", target_system=31, target_component=0, seq=block, name="")
            rig.wait_s(0.3)


def blocks_told(rig: LockstepRig) -> list[int]:
    return [int(number(message, "seq")) for message in rig.told("SCRIPT_ITEM")]


def attend_until(vehicle: MavlinkVehicle, condition: Callable[[], bool], within_s: float = 30.0) -> None:
    """In seconds of the rig's own time."""
    for _ in range(round(within_s / 0.2)):
        if condition():
            return
        vehicle.attend(0.2)
    raise AssertionError(f"still {vehicle.condition()}")


def test_a_connected_vehicle_reports_its_identity_and_state() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.attend(12.0)
        condition = vehicle.condition()
        assert replace(vehicle.identity, version="") == PINNED
        assert (vehicle.concern, condition.step, condition.armed, condition.held) == ("", "idle", False, SAFE)
        assert condition.altitude_m == pytest.approx(0.1, abs=0.05)
        assert condition.position_hz == pytest.approx(51.0, abs=4.0)
        assert condition.packet_age_s is not None
        assert condition.packet_age_s < 0.5
        assert condition.heartbeat_age_s is not None
        assert condition.heartbeat_age_s < 1.5
        assert condition.lost_share == pytest.approx(0.0, abs=0.01)
        assert condition.battery_v is not None
        assert condition.trouble == ""


def test_the_version_is_asked_of_autopilots_that_answer_and_a_new_one_is_a_concern() -> None:
    with LockstepRig("ardupilot") as rig:
        with connected(rig) as vehicle:
            known = vehicle.identity
            assert (known.system_id, known.autopilot, known.version.count(".")) == (1, "ardupilot", 2)
        with connected(rig, replace(known, version="3.2.1")) as vehicle:
            assert vehicle.concern == f"Its firmware has changed from version 3.2.1 to {known.version}."
            with pytest.raises(SafeGainsError, match="only observed"):
                vehicle.stage(OWN_SAFE["ardupilot"])
            vehicle.release()
            assert vehicle.concern == ""


def test_a_new_version_that_is_told_only_later_is_a_concern_until_a_person_has_looked() -> None:
    """Paparazzi sends its version every few seconds without a request."""
    with LockstepRig() as rig, connected(rig, replace(PINNED, version="5.8.0")) as vehicle:
        attend_until(vehicle, lambda: bool(vehicle.concern))
        assert vehicle.concern == f"Its firmware has changed from version 5.8.0 to {vehicle.identity.version}."
        with pytest.raises(SafeGainsError, match="only observed"):
            vehicle.stage(TUNED)
        vehicle.release()
        vehicle.attend(2.0)
        assert (vehicle.concern, vehicle.stage(TUNED)) == ("", TUNED)


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_another_vehicle_of_the_same_make_and_version_is_only_observed_until_a_person_takes_it_as_this_one(
    autopilot: str,
) -> None:
    with LockstepRig(autopilot) as rig:
        with connected(rig) as vehicle:
            known = vehicle.identity
            assert int(known.uid, 16) != 0
        with connected(rig, replace(known, uid="00112233")) as vehicle:
            assert f"its hardware id is {known.uid} instead of 00112233" in vehicle.concern
            assert "Register it as a new vehicle, or release it to accept it in place of this one" in vehicle.concern
            written = list(rig.writes)
            with pytest.raises(SafeGainsError, match="hardware id"):
                vehicle.stage(OWN_SAFE[autopilot])
            with pytest.raises(SafeGainsError, match="hardware id"):
                vehicle.restore()
            vehicle.attend(1.0)
            assert rig.writes == written
            vehicle.release()
            assert (vehicle.concern, vehicle.identity) == ("", known)
            assert vehicle.stage(OWN_SAFE[autopilot]) == OWN_SAFE[autopilot]


def test_a_vehicle_that_does_not_report_its_known_hardware_id_gets_no_gains_until_released() -> None:
    """Another vehicle whose answer is lost, or a firmware that no longer reports the id."""
    with LockstepRig("px4") as rig:
        rig.drone.autopilot.uid = 0  # type: ignore[attr-defined]
        pin = Identity(system_id=1, autopilot="px4", version="1.16.0", uid="0000000000000007")
        with connected(rig, pin) as vehicle:
            assert "It did not report its hardware id" in vehicle.concern
            item = next(item for item in vehicle.check() if item.name == "hardware_id")
            assert (item.passed, item.found) == (False, "not reported")
            assert item.needed == "0000000000000007, as registered"
            with pytest.raises(VehicleError, match="did not report its hardware id"):
                vehicle.restore()
            assert not rig.told("PARAM_SET")
            vehicle.release()
            assert (vehicle.concern, vehicle.identity.uid) == ("", "")
            assert vehicle.stage(OWN_SAFE["px4"]) == OWN_SAFE["px4"]
            assert not [item for item in vehicle.check() if item.name == "hardware_id"]


@pytest.mark.complete
def test_the_first_hardware_id_reported_is_pinned() -> None:
    """Pinned by a release that did not look at it."""
    with LockstepRig("px4") as rig:
        autopilot = rig.drone.autopilot
        autopilot.uid = 0  # type: ignore[attr-defined]
        with connected(rig, Identity(system_id=1, autopilot="px4", version="1.16.0")) as vehicle:
            assert (vehicle.concern, vehicle.identity.uid) == ("", "")
            swap(rig, vehicle, 7)
            vehicle.check()
            assert (vehicle.concern, vehicle.identity.uid) == ("", "0000000000000007")
            swap(rig, vehicle, 9)
            vehicle.check()
            assert "hardware id is 0000000000000009" in vehicle.concern


def swap(rig: LockstepRig, vehicle: MavlinkVehicle, uid: int) -> None:
    """Another drone of the same type is switched on in the place of this one."""
    rig.muted = True
    vehicle.attend(8.0)
    rig.drone.autopilot.uid = uid  # type: ignore[attr-defined]
    rig.muted = False


@pytest.mark.complete
def test_a_vehicle_that_is_swapped_while_the_link_stays_open_is_asked_who_it_is_before_anything_is_written() -> None:
    with LockstepRig("px4") as rig, connected(rig) as vehicle:
        known = vehicle.identity
        swap(rig, vehicle, 9)
        vehicle.attend(3.0)
        written = list(rig.writes)
        with pytest.raises(SafeGainsError, match="hardware id is 0000000000000009"):
            vehicle.stage(OWN_SAFE["px4"])
        assert rig.writes == written
        swap(rig, vehicle, int(known.uid, 16))
        vehicle.attend(3.0)
        vehicle.release()
        assert (vehicle.concern, vehicle.identity) == ("", known)


class LossyRig(LockstepRig):
    """Transport that loses the drone's identity messages before `lost_until_s`."""

    lost_until_s = 0.0

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        if self.now_s() >= self.lost_until_s:
            return frames
        codec = AUTOPILOTS[self.autopilot].dialect.codec(system=1, component=1)
        return [frame for frame in frames if codec.parse(frame)[0].get_type() != "AUTOPILOT_VERSION"]


def test_another_vehicle_than_the_pinned_one_whose_answers_are_lost_while_it_connects_is_observed() -> None:
    pin = Identity(system_id=1, autopilot="px4", version="1.16.0", uid="0000000000000007")
    with LossyRig("px4") as rig:
        rig.lost_until_s = rig.now_s() + 3.0
        with connected(rig, pin) as vehicle:
            assert rig.now_s() > rig.lost_until_s
            assert f"hardware id is {vehicle.identity.uid} instead of {pin.uid}" in vehicle.concern
            assert rig.writes == []


def test_a_new_version_that_is_told_late_while_a_vehicle_connects_is_a_concern() -> None:
    with LossyRig("px4") as rig:
        with connected(rig) as vehicle:
            known = vehicle.identity
        rig.lost_until_s = rig.now_s() + 3.0
        with connected(rig, replace(known, version="1.2.3")) as vehicle:
            assert vehicle.concern == f"Its firmware has changed from version 1.2.3 to {known.version}."


def stage(vehicle: MavlinkVehicle) -> None:
    vehicle.stage(OWN_SAFE["px4"])


def fly(vehicle: MavlinkVehicle) -> None:
    vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)


OTHER = "hardware id is 0000000000000009"


@pytest.mark.parametrize(
    ("ask", "lost_s", "says"),
    [
        (stage, 4.0, OTHER),
        (fly, 0.0, OTHER),
        (MavlinkVehicle.release, 0.0, OTHER),
        (MavlinkVehicle.release, math.inf, "did not report its hardware id"),
    ],
)
def test_a_vehicle_that_was_swapped_gets_nothing_until_a_person_has_seen_that_it_was(
    ask: Callable[[MavlinkVehicle], None], lost_s: float, says: str
) -> None:
    """Staged and quarantined, or not, while its answers are lost for so long."""
    with LossyRig("px4") as rig:
        rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            vehicle.attend(2.0)
            stage(vehicle)
            if ask is MavlinkVehicle.release:
                vehicle._observe("Somebody else armed it.")
            swap(rig, vehicle, 9)
            vehicle.attend(3.0)
            written = list(rig.writes)
            rig.lost_until_s = rig.now_s() + lost_s
            with pytest.raises(VehicleError, match=says) as refusal:
                ask(vehicle)
            assert refusal.value.not_flown == (ask is fly)
            assert rig.writes == written
            assert says in vehicle.concern
            assert ("Somebody else armed it." in vehicle.concern) == (ask is MavlinkVehicle.release)
            vehicle.release()
            assert (vehicle.concern, vehicle.identity.uid) == ("", "" if lost_s == math.inf else "0000000000000009")


@pytest.mark.complete
def test_a_vehicle_that_was_away_and_whose_answers_are_lost_is_not_flown() -> None:
    with LossyRig("px4") as rig:
        rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            known = vehicle.identity
            vehicle.attend(2.0)
            vehicle.stage(OWN_SAFE["px4"])
            swap(rig, vehicle, int(known.uid, 16))
            vehicle.attend(3.0)
            written = list(rig.writes)
            rig.lost_until_s = math.inf
            with pytest.raises(VehicleError, match="Hardware id: not reported, required: ") as refusal:
                vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)
            assert refusal.value.not_flown
            assert "It did not report its hardware id" in vehicle.concern
            assert [name for name in rig.writes[len(written) :] if name.startswith("MPC_")] == []


@pytest.mark.complete
def test_a_vehicle_that_was_not_listened_to_for_a_while_is_asked_who_it_is_and_passes_its_checks() -> None:
    with LockstepRig("px4") as rig:
        rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            rig.wait_s(8.0)
            assert [item.name for item in vehicle.check() if not item.passed] == []
            rig.wait_s(8.0)
            assert vehicle.stage(OWN_SAFE["px4"]) == OWN_SAFE["px4"]


def test_a_release_verifies_the_gains_also_of_a_vehicle_that_seems_to_be_in_order() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.stage(TUNED)
        vehicle.release()
        assert (vehicle.condition().held, vehicle.read_gains()) == (SAFE, SAFE)


def test_a_vehicle_that_is_armed_while_it_is_staged_is_given_nothing_more() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        rig.drone.autopilot._enter(START_ENGINE)  # type: ignore[attr-defined]  # as by remote control
        while vehicle.condition().armed is not True:
            vehicle._radio.listen(0.1)  # while it writes
        written = list(rig.writes)
        vehicle._restore_or_quarantine()
        assert (vehicle.condition().step, rig.writes) == ("observing", written)


def test_another_vehicle_than_the_pinned_one_is_not_taken_for_it() -> None:
    with (
        LockstepRig() as rig,
        pytest.raises(VehicleError, match="system 31 instead of 7"),
        connected(rig, replace(PINNED, system_id=7)),
    ):
        pass


@pytest.mark.complete
def test_a_session_flies_twice_each_flight_with_a_log_of_its_own(tmp_path: Path) -> None:
    paths = [tmp_path / "flight-1.tlog", tmp_path / "flight-2.tlog"]
    steps: set[str] = set()
    with LockstepRig() as rig, connected(rig, PINNED) as vehicle:

        def look(_sample: Sample) -> None:
            steps.add(vehicle.condition().step)

        for path in paths:
            vehicle.attend(0.5)
            vehicle.log_to(path)
            assert vehicle.stage(TUNED) == TUNED
            record = vehicle.fly(ORDER, on_sample=look, should_stop=Watcher(abort_at_s=2.0).decide)
            assert (record.ending, vehicle.condition().held, vehicle.condition().step) == ("completed", SAFE, "idle")
            vehicle.log_to(None)
    assert {"record"} <= steps
    for path in paths:
        with closing(mavutil.mavlink_connection(str(path), dialect="paparazzi")) as log:
            kinds = {message.get_type() for message in iter(log.recv_msg, None)}
        assert {"PARAM_SET", "LOCAL_POSITION_NED", "HEARTBEAT"} <= kinds


def test_a_check_judges_everything_and_raises_nothing() -> None:
    with LockstepRig("px4") as rig, connected(rig, min_battery_v=20.0) as vehicle:
        items = {item.name: item for item in vehicle.check()}
        assert {name for name, item in items.items() if not item.passed} == {
            "battery",
            "failsafe NAV_DLL_ACT",
            "failsafe GF_MAX_VER_DIST",
        }
        assert {"heartbeat", "disarmed", "position", "clock", "still", "gains"} <= set(items)
        assert items["gains"].found == items["gains"].needed
        assert items["battery"].needed == "20 V or more"
        vehicle.stage(OWN_SAFE["px4"])
        with pytest.raises(VehicleError, match=r"Battery: .* required: 20 V or more"):
            vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)


def test_gains_that_changed_after_they_were_staged_are_not_flown() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.stage(TUNED)
        rig.change_last_parameter()
        with pytest.raises(VehicleError, match=r"Gains: kp .* required: kp 1600"):
            vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)
        assert vehicle.restore() == SAFE


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "paparazzi"])
def test_a_restart_between_flights_is_noticed_before_the_next_which_then_flies(autopilot: str) -> None:
    """Observed defect: a restarted ArduCopter sends heartbeats only. Its restart was noticed as it was about to take
    off, which failed."""
    with LockstepRig(autopilot) as rig, connected(rig) as vehicle:
        if autopilot != "paparazzi":
            rig.switch_on_failsafes()
        vehicle.attend(15.0)
        rig.drone.reboot()
        attend_until(vehicle, lambda: vehicle.condition().held == {}, within_s=8.0)
        assert "It restarted" in vehicle.condition().trouble
        vehicle.stage(OWN_SAFE[autopilot])
        assert vehicle.condition().trouble == ""
        assert vehicle.fly(ORDER, on_sample=unwatched, should_stop=never).ending == "completed"


@pytest.mark.complete
def test_a_restart_is_noticed_by_staging_itself() -> None:
    with LockstepRig("ardupilot") as rig, connected(rig) as vehicle:
        rig.switch_on_failsafes()
        vehicle.attend(15.0)
        rig.drone.reboot()
        rig.wait_s(6.0)
        vehicle.stage(OWN_SAFE["ardupilot"])
        assert vehicle.fly(ORDER, on_sample=unwatched, should_stop=never).ending == "completed"


class GapRig(LockstepRig):
    """Loses the drone's packets in a span of its time."""

    lost = (math.inf, math.inf)

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        return [] if self.lost[0] <= self.drone.time_s < self.lost[1] else frames


@pytest.mark.parametrize("lost_s", [0.0, 1.0])
def test_every_parameter_can_be_read_also_where_some_are_lost(lost_s: float) -> None:
    """Lost for so long, in which the drone sends about five of them, and asked for one by one."""
    with GapRig() as rig, connected(rig) as vehicle:
        since_s, asked = rig.drone.time_s + 4.0, len(rig.told("PARAM_REQUEST_READ"))
        rig.lost = since_s, since_s + lost_s
        found = vehicle.parameters()
        assert rig.drone.time_s > since_s
        assert (len(rig.told("PARAM_REQUEST_READ")) > asked) is (lost_s > 0.0)
    assert found["gui_v_kp"] == 283.0
    assert len(found) > 50


@pytest.mark.complete
def test_a_vehicle_met_in_the_air_is_observed_landed_and_released_by_a_person() -> None:
    with LockstepRig() as rig:
        enter_block(rig, START_ENGINE, TAKE_OFF)
        rig.wait_s(3.0)
        assert rig.drone.body.altitude_m > 1.0
        with connected(rig, PINNED) as vehicle:
            assert rig.writes == []
            assert (vehicle.condition().step, vehicle.condition().armed) == ("observing", True)
            assert "armed: either somebody else armed it" in vehicle.concern
            for ask in (lambda: vehicle.stage(SAFE), vehicle.restore, vehicle.release):
                with pytest.raises(SafeGainsError):
                    ask()
            assert not next(item for item in vehicle.check() if item.name == "disarmed").passed
            vehicle.land("it is not ours")
            assert "Land was requested: it is not ours." in vehicle.concern
            attend_until(vehicle, lambda: rig.drone.body.stands)
            assert LAND_HERE in blocks_told(rig)
            vehicle.motors_off("it has landed")
            attend_until(vehicle, lambda: vehicle.condition().armed is False)
            vehicle.release()
            assert (vehicle.concern, vehicle.condition().step, vehicle.read_gains()) == ("", "idle", SAFE)


@pytest.mark.complete
def test_land_is_repeated_every_second_until_the_vehicle_obeys_and_not_afterwards() -> None:
    with LockstepRig() as rig:
        enter_block(rig, START_ENGINE, TAKE_OFF)
        with connected(rig) as vehicle:
            rig.muted = True
            vehicle.land("no answer comes")
            before = blocks_told(rig).count(LAND_HERE)
            vehicle.attend(3.5)
            assert 2 <= blocks_told(rig).count(LAND_HERE) - before <= 5
            rig.muted = False
            vehicle.attend(2.5)
            obeyed = blocks_told(rig).count(LAND_HERE)
            vehicle.attend(4.0)
            assert blocks_told(rig).count(LAND_HERE) == obeyed


def test_motors_off_is_repeated_too_until_the_vehicle_says_so() -> None:
    with LockstepRig() as rig:
        enter_block(rig, START_ENGINE)
        with connected(rig) as vehicle:
            rig.muted = True
            vehicle.motors_off("it stands among people")
            vehicle.attend(2.5)
            assert 2 <= rig.writes.count("kil_thr") <= 4
            rig.muted = False
            attend_until(vehicle, lambda: vehicle.condition().armed is False)
            vehicle.attend(1.5)
            stopped = rig.writes.count("kil_thr")
            vehicle.attend(3.0)
            assert rig.writes.count("kil_thr") == stopped


def test_motors_off_that_no_message_confirms_leaves_the_vehicle_only_observed() -> None:
    """Seen: it was shown as ready, and the command as done."""
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.attend(2.0)
        rig.muted = True
        vehicle.motors_off("it stands among people")
        vehicle.attend(4.0)
        assert (vehicle.has_stopped, vehicle.concern) == (None, "")
        vehicle.attend(2.0)
        assert vehicle.has_stopped is False
        assert vehicle.concern == (
            "Motors off was requested: it stands among people. "
            "The vehicle has not confirmed within 5 s that its motors stopped."
        )
        with pytest.raises(SafeGainsError, match="has not confirmed"):
            vehicle.stage(TUNED)
        rig.muted = False
        vehicle.attend(2.0)
        vehicle.release()
        assert vehicle.concern == ""


def test_motors_off_that_the_vehicle_confirms_on_the_ground_leaves_it_ready() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.attend(2.0)
        vehicle.motors_off("to be sure")
        vehicle.attend(2.0)
        assert (vehicle.has_stopped, vehicle.concern) == (True, "")


def test_motors_off_that_may_have_dropped_the_vehicle_leaves_it_only_observed() -> None:
    """Somebody else has just armed it, as one heartbeat tells."""
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.attend(2.0)
        rig.drone.autopilot._enter(START_ENGINE)  # type: ignore[attr-defined]  # as by remote control
        attend_until(vehicle, lambda: vehicle.condition().armed is True)
        vehicle.motors_off("nobody is to fly")
        attend_until(vehicle, lambda: vehicle.has_stopped is True)
        assert vehicle.concern == (
            "Motors off was requested: nobody is to fly. "
            "The vehicle was not known to be on the ground: inspect it before it flies again."
        )


def test_a_vehicle_that_somebody_else_arms_is_only_observed_from_then_on() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.stage(TUNED)
        rig.drone.autopilot._enter(START_ENGINE)  # type: ignore[attr-defined]  # as by remote control
        attend_until(vehicle, lambda: vehicle.condition().armed is True)
        assert (vehicle.condition().step, vehicle.concern) == ("idle", "")  # one heartbeat may be somebody else's
        with pytest.raises(SafeGainsError, match="armed"):
            vehicle.stage(TUNED)
        attend_until(vehicle, lambda: vehicle.condition().step == "observing", within_s=1.5)
        assert vehicle.concern


@pytest.mark.complete
def test_what_was_ordered_is_repeated_also_while_something_else_takes_its_time() -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        enter_block(rig, START_ENGINE, TAKE_OFF)
        attend_until(vehicle, lambda: (vehicle.condition().altitude_m or 0.0) > 1.0)
        rig.muted = True
        vehicle.land("nobody hears it")
        told = blocks_told(rig).count(LAND_HERE)
        vehicle.check()
        assert blocks_told(rig).count(LAND_HERE) >= told + 5


@pytest.mark.parametrize("raises_once", [False, pytest.param(True, marks=pytest.mark.complete)])
def test_motors_off_is_heard_also_after_the_program_failed_while_the_vehicle_lands(raises_once: bool) -> None:
    """Whoever watches the flight raises, perhaps whoever is asked whether to stop too; then a person acts."""
    asked: list[float] = []

    def fail(sample: Sample) -> None:
        if sample.time_s > 8.0:
            raise RuntimeError("the disk is full")

    def slide() -> StopRequest | None:
        if rig.drone.body.altitude_m > 2.0 and vehicle.condition().step == "abort-land":
            asked.append(rig.now_s())
            if raises_once and len(asked) == 1:
                raise OSError("the pipe is broken")
            return StopRequest("people below", motors_off=True)
        return None

    with LockstepRig("ardupilot") as rig:
        rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            vehicle.attend(2.0)
            vehicle.stage(OWN_SAFE["ardupilot"])
            with pytest.raises(RuntimeError, match="the disk is full"):
                vehicle.fly(ORDER, on_sample=fail, should_stop=slide)
            forced = [
                at_s for at_s, it in rig.heard if it.get_type() == "COMMAND_LONG" and number(it, "param2") == 21196
            ]
            assert forced[0] - asked[0] < 0.3
            assert vehicle.concern.endswith(
                " The vehicle was 3.0 m above the ground: inspect it before it flies again."
            )
            vehicle.release()
            assert (vehicle.concern, vehicle.read_gains()) == ("", OWN_SAFE["ardupilot"])


def test_a_log_that_cannot_be_written_is_reported_and_the_previous_one_continues(tmp_path: Path) -> None:
    with LockstepRig() as rig, connected(rig) as vehicle:
        vehicle.log_to(tmp_path / "first.tlog")
        with pytest.raises(VehicleError, match="cannot be written"):
            vehicle.log_to(tmp_path / "nowhere" / "second.tlog")
        vehicle.attend(0.5)
        assert vehicle.condition().trouble == ""
    assert (tmp_path / "first.tlog").stat().st_size > 0


@pytest.mark.parametrize("autopilot", ["ardupilot", "paparazzi", "px4"])
@pytest.mark.parametrize("away_s", [0.2, 2.2, pytest.param(30.0, marks=pytest.mark.complete)])
def test_a_release_after_a_restart_leaves_no_doubt_about_the_gains(autopilot: str, away_s: float) -> None:
    """While it boots, as it answers again, and long after."""
    system = 31 if autopilot == "paparazzi" else 1
    earlier = Identity(system_id=system, autopilot=autopilot, version="0.1")
    with LockstepRig(autopilot) as rig, connected(rig, earlier) as vehicle:
        vehicle.attend(1.0)
        rig.drone.reboot()
        vehicle.attend(away_s)
        vehicle.release()
        vehicle.attend(3.0)
        assert (vehicle.condition().trouble, vehicle.condition().held) == ("", OWN_SAFE[autopilot])
