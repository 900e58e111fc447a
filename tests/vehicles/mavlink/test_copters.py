"""What the real ArduCopter and PX4 were seen to do, done by the simulated ones, and what the program makes of it."""

import math
import random
import struct
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from app.autopilots.dialects import Message
from app.autopilots.measurements import VehicleEvent
from app.autopilots.px4.arming_checks import ARMING_CHECK_SUMMARY, Px4ArmingChecks
from app.autopilots.px4.simulated import Px4
from app.autopilots.simulated.body import OutgoingMessage
from app.simdrone.fault_kinds import Fault
from app.vehicles.base import FlightOptions, FlightRecord, Identity, VehicleError
from app.vehicles.flight_end import StopRequest
from app.vehicles.mavlink.vehicle import STANDSTILL_S, MavlinkVehicle
from app.vehicles.mavlink_kind import MAVLINK
from tests.vehicles.flying import never, unwatched
from tests.vehicles.mavlink.rigs import SAFE, LockstepRig, UdpRig, copter_of
from tests.vehicles.mavlink.test_connected import connected

ORDER = FlightOptions(seed=1, window_s=12.0)
LAND_MODE, HOLD_MODE = "4.6", "4.3"


def ready(autopilot: str) -> LockstepRig:
    rig = LockstepRig(autopilot)
    rig.switch_on_failsafes()
    return rig


def fly(vehicle: MavlinkVehicle, autopilot: str, order: FlightOptions = ORDER) -> FlightRecord:
    vehicle.stage(SAFE[autopilot])
    return vehicle.fly(order, on_sample=unwatched, should_stop=never)


@pytest.mark.complete
def test_an_ardupilot_that_sends_only_requested_messages_can_be_flown() -> None:
    """Observed on a direct link: no voltage was reported, because SYS_STATUS had not been requested."""
    with ready("ardupilot") as rig:
        rig.wait_s(3.0)
        kinds = {message.get_type() for message in _heard(rig)}
        assert kinds <= {"HEARTBEAT", "PARAM_VALUE", "STATUSTEXT"}
        with connected(rig) as vehicle:
            vehicle.attend(2.0)
            assert [item.name for item in vehicle.check() if not item.passed] == []
            assert fly(vehicle, "ardupilot").ending == "completed"


def _heard(rig: LockstepRig) -> list[Message]:
    codec = rig._codec
    return [message for data, _ in rig.read(0.0) for message in codec.parse(data)]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_first_connection_reads_the_gains_and_writes_nothing(autopilot: str) -> None:
    """Seen: 0.3 overwritten with 0.5, for good."""
    name = "PSC_ACCZ_P" if autopilot == "ardupilot" else "MPC_Z_P"
    with ready(autopilot) as rig:
        rig.drone.autopilot.parameters[name] = 0.3
        kind = rig.options()
        vehicle = MavlinkVehicle(
            kind, SAFE[autopilot], is_real=True, clock=rig, transport=rig, observes=True, decided=False
        )
        assert f"{name} 0.3" in vehicle.concern
        assert "nothing was written" in vehicle.concern
        assert vehicle.condition().held[name] == pytest.approx(0.3)
        assert name not in rig.writes[3:]
        assert rig.drone.autopilot.parameters[name] == 0.3
        vehicle.release()  # a person's word: the named ones
        assert rig.drone.autopilot.parameters[name] == SAFE[autopilot][name]
        vehicle.close()


def test_a_first_connection_that_finds_the_safe_gains_needs_no_word() -> None:
    with ready("px4") as rig:
        vehicle = MavlinkVehicle(
            rig.options(), SAFE["px4"], is_real=True, clock=rig, transport=rig, observes=True, decided=False
        )
        assert vehicle.concern == ""
        vehicle.close()


class AltitudeAnew(Fault):
    """An estimator that puts its origin half a metre lower as it is armed."""

    name = "altitude-anew"

    def transform_messages(self, letters: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [self._raised(letter) for letter in letters]

    def _raised(self, letter: OutgoingMessage) -> OutgoingMessage:
        z = letter.fields.get("z")
        if letter.kind != "LOCAL_POSITION_NED" or not self.drone.autopilot.armed:
            return letter
        assert isinstance(z, float)
        return replace(letter, fields={**letter.fields, "z": z - 0.5})


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_heights_count_from_the_ground_though_the_altitude_begins_anew_at_arming(
    autopilot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.simdrone.drone.FAULTS", {AltitudeAnew.name: AltitudeAnew})
    with LockstepRig(autopilot, faults=["altitude-anew@connect"]) as rig:
        rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            record = fly(vehicle, autopilot, replace(ORDER, window_s=20.0))
            assert (record.ending, vehicle.concern) == ("completed", "")
    time_s, altitude_m = record.trajectory.time_s, record.trajectory["altitude_m"]
    assert altitude_m[time_s >= 0.0][0] == pytest.approx(0.0, abs=0.05)
    assert altitude_m[(time_s > 17.0) & (time_s < 20.0)] == pytest.approx(3.0, abs=0.1)


@pytest.mark.complete
def test_what_a_trial_sets_beside_the_gains_is_put_back() -> None:
    with ready("px4") as rig, connected(rig) as vehicle:
        assert rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] == 2.5
        flown: list[float] = []

        def look() -> StopRequest | None:
            if rig.drone.body.altitude_m > 2.0:
                flown.append(rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"])
            return StopRequest("seen enough") if len(flown) > 100 else None

        vehicle.stage(SAFE["px4"])
        vehicle.fly(ORDER, on_sample=unwatched, should_stop=look)
        assert set(flown) == {3.0}
        assert rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] == 2.5


KEPT_IN = "udp-127.0.0.1-4245-4244-px4-1-4741494e4c494e01.json"
"""The address and the identity of the rig's drone."""
KEPT = '{"vehicle": "px4 1", "parameters": {"MIS_TAKEOFF_ALT": [2.5, 3.0]}}'


@pytest.mark.complete
def test_what_a_trial_sets_is_kept_on_disk_until_it_is_put_back(tmp_path: Path) -> None:
    file, kept = tmp_path / KEPT_IN, set[str]()
    with ready("px4") as rig, connected(rig, trial_parameters=tmp_path) as vehicle:

        def look() -> StopRequest | None:
            if rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] == 3.0:
                kept.add(file.read_text())
            return StopRequest("seen enough") if rig.drone.body.altitude_m > 0.5 else None

        vehicle.stage(SAFE["px4"])
        vehicle.fly(ORDER, on_sample=unwatched, should_stop=look)
        assert kept == {KEPT}
        assert not file.exists()


@pytest.mark.parametrize(
    ("held", "afterwards"),
    [pytest.param(3.0, 2.5, id="as the trial left it"), pytest.param(5.0, 5.0, id="changed by somebody since")],
)
def test_what_a_killed_process_had_set_is_put_back_by_the_next_one(
    tmp_path: Path, held: float, afterwards: float
) -> None:
    file = tmp_path / KEPT_IN
    file.write_text(KEPT)
    with ready("px4") as rig:
        rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] = held
        with connected(rig, trial_parameters=tmp_path) as vehicle:
            assert vehicle.concern == ""
            assert rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] == afterwards
            assert not file.exists()


def test_what_the_vehicle_does_not_tell_is_kept_until_it_does(tmp_path: Path) -> None:
    file = tmp_path / KEPT_IN
    file.write_text(KEPT)
    with ready("px4") as rig:
        rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] = math.nan  # it tells none
        with connected(rig, trial_parameters=tmp_path) as vehicle:
            assert "MIS_TAKEOFF_ALT could not be restored to 2.5" in vehicle.concern
            assert file.read_text() == KEPT
            rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] = 3.0
            vehicle.release()
            assert rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] == 2.5
            assert not file.exists()


def test_what_was_set_on_another_vehicle_is_not_put_back_on_this_one(tmp_path: Path) -> None:
    file = tmp_path / KEPT_IN
    file.write_text(KEPT.replace("px4 1", "px4 2"))
    with ready("px4") as rig:
        rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] = 3.0
        with connected(rig, trial_parameters=tmp_path):
            assert rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] == 3.0


def test_vehicles_of_one_type_that_have_one_address_by_turns_are_kept_apart(tmp_path: Path) -> None:
    file = tmp_path / KEPT_IN
    file.write_text(KEPT)
    with ready("px4") as rig:
        autopilot = rig.drone.autopilot
        autopilot.parameters["MIS_TAKEOFF_ALT"] = 3.0
        own, autopilot.uid = autopilot.uid, 7  # type: ignore[attr-defined]
        with connected(rig, trial_parameters=tmp_path):
            assert (autopilot.parameters["MIS_TAKEOFF_ALT"], file.read_text()) == (3.0, KEPT)
        autopilot.uid = own  # type: ignore[attr-defined]
        with connected(rig, trial_parameters=tmp_path):
            assert (autopilot.parameters["MIS_TAKEOFF_ALT"], file.exists()) == (2.5, False)


@pytest.mark.parametrize(("simulated", "afterwards"), [(False, 2.5), (True, 3.0)])
def test_what_a_killed_process_had_set_is_put_back_under_another_address_where_the_hardware_id_is_the_vehicles_own(
    tmp_path: Path, simulated: bool, afterwards: float
) -> None:
    """Simulated vehicles of one system id may all tell the same one."""
    file = tmp_path / KEPT_IN
    file.write_text(KEPT)
    with ready("px4") as rig:
        rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] = 3.0
        with connected(
            rig, trial_parameters=tmp_path, address="udp:127.0.0.1:14580@14550", simulated=simulated
        ) as vehicle:
            assert (vehicle.concern, rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"]) == ("", afterwards)
            assert file.exists() == simulated


def test_what_a_killed_process_had_set_is_put_back_before_anybody_has_decided_about_the_gains(tmp_path: Path) -> None:
    """As `gainline run` and a first connection meet it: gains are compared, and these are the safe ones."""
    file = tmp_path / KEPT_IN
    file.write_text(KEPT)
    with ready("px4") as rig:
        rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] = 3.0
        first = partial(MavlinkVehicle, rig.options(), SAFE["px4"], is_real=False, observes=True, decided=False)
        with closing(first(clock=rig, transport=rig, trial_parameters=tmp_path)) as vehicle:
            assert (vehicle.concern, rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"]) == ("", 2.5)
            assert not file.exists()


@pytest.mark.parametrize("damaged", ["[2.5", "[2.5]", "{}", '{"vehicle": "px4 1", "parameters": {"A": 1}}'])
def test_a_vehicle_whose_kept_parameters_cannot_be_read_is_only_observed(tmp_path: Path, damaged: str) -> None:
    file = tmp_path / KEPT_IN
    file.write_text(damaged)
    with ready("px4") as rig, connected(rig, trial_parameters=tmp_path) as vehicle:
        assert (
            f"{KEPT_IN}, which keeps parameters that a trial changed on the vehicle, cannot be used" in vehicle.concern
        )
        assert "MIS_TAKEOFF_ALT" not in rig.writes
        assert file.read_text() == damaged


@pytest.mark.complete
def test_a_vehicle_that_is_connected_as_the_program_does_it_keeps_that_file(tmp_path: Path) -> None:
    folder = tmp_path / "parameters"
    folder.write_text("no folder")
    assert MAVLINK.connect is not None
    with UdpRig("px4", speed=3.0) as rig:
        options = rig.options()
        identity = Identity(system_id=1, autopilot="px4", version="")
        vehicle = MAVLINK.connect(options, SAFE["px4"], folder, identity, lambda: None, False)
        with closing(vehicle):
            assert f"The file {folder}/udp-127.0.0.1-" in vehicle.concern


def test_what_a_refused_run_had_set_is_put_back_too() -> None:
    with LockstepRig("px4", faults=["arm-refused@5"]) as rig:
        rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            vehicle.stage(SAFE["px4"])
            rig.drone.autopilot.refuses_arming = True
            rig.drone.autopilot.prearm_failure = lambda: None  # type: ignore[attr-defined]  # it does not tell before
            with pytest.raises(VehicleError) as refusal:
                vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)
            assert refusal.value.not_flown
            assert rig.drone.autopilot.parameters["MIS_TAKEOFF_ALT"] == 2.5


@pytest.mark.parametrize(
    ("mode", "title"), [("AUTO.LAND", "Land"), ("OFFBOARD", "Offboard"), ("AUTO.TAKEOFF", "Takeoff")]
)
def test_a_px4_is_brought_out_of_a_mode_in_which_it_cannot_be_armed_for_a_flight(mode: str, title: str) -> None:
    """The real one was in Offboard after 2 of 7 landings, and refused every later flight while the checks passed."""
    with ready("px4") as rig, connected(rig) as vehicle:
        copter = copter_of(rig.drone)
        copter.mode = copter.find_mode(mode)
        vehicle.attend(4.0)
        assert vehicle.condition().mode == title
        assert [item.name for item in vehicle.check() if not item.passed] == []
        assert vehicle.condition().mode == "Hold"


@pytest.mark.complete
def test_a_px4_that_refuses_to_leave_its_mode_is_not_flown() -> None:
    """It says that it may not be armed by saying nothing, also to a ground station that has never heard it."""
    with ready("px4") as rig:
        copter = copter_of(rig.drone)
        copter.mode = copter.find_mode("OFFBOARD")
        copter.mode_refusal = lambda _mode: "not available"  # type: ignore[method-assign]
        rig.wait_s(4.0)
        with connected(rig) as vehicle:
            [own] = [item for item in vehicle.check() if item.name == "own_checks"]
            assert not own.passed
            assert own.found.startswith("not passed; messages: not available / ")


def test_a_px4_that_never_reports_whether_it_may_be_armed_is_not_refused_for_that() -> None:
    """Before release 1.11 it had neither the bit in SYS_STATUS nor events."""
    with ready("px4") as rig:
        assert isinstance(rig.drone.autopilot, Px4)
        rig.drone.autopilot._send_check_events = lambda: None  # type: ignore[method-assign]
        rig.drone.autopilot.prearm_failure = lambda: ""  # type: ignore[method-assign]
        with connected(rig) as vehicle:
            vehicle.attend(4.0)
            items = vehicle.check()
            assert "own_checks" not in {item.name for item in items}
            assert [item.name for item in items if not item.passed] == []


class LossyRig(LockstepRig):
    """Loses this share of the drone's packets."""

    lost_share = 0.0

    def __init__(self, autopilot: str) -> None:
        super().__init__(autopilot)
        self.chance = random.Random(1)

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        return [frame for frame in frames if self.chance.random() >= self.lost_share]


@pytest.mark.parametrize(("lost_share", "passes"), [(0.3, False), (0.15, True)])
@pytest.mark.parametrize(
    ("autopilot", "telemetry_hz", "sent_hz"),
    [
        ("paparazzi", 50.0, 51.2),
        *(pytest.param(other, 50.0, 51.2, marks=pytest.mark.complete) for other in ("ardupilot", "px4")),
        pytest.param("px4", 100.0, 128.0, marks=pytest.mark.complete),
    ],
)
def test_a_link_that_loses_three_positions_in_ten_is_refused(
    autopilot: str, telemetry_hz: float, sent_hz: float, lost_share: float, passes: bool
) -> None:
    """By those of a single second, in which 40 may arrive, one flight in ten was let off; at 100 a second, all."""
    with LossyRig(autopilot) as rig, connected(rig, telemetry_hz=telemetry_hz) as vehicle:
        vehicle.attend(4.0)
        rig.lost_share = lost_share
        vehicle.attend(11.0)
        for _ in range(3):
            _, items = vehicle._check(STANDSTILL_S)
            [item] = [item for item in items if item.name == "position"]
            assert item.passed is passes
            rate_hz, lost_percent = (float(part.split()[0]) for part in item.found.split(", "))
            assert rate_hz == pytest.approx(sent_hz * (1.0 - lost_share), rel=0.1)
            assert lost_percent == pytest.approx(100.0 * lost_share, abs=6.0)


class LateOffboardRig(LockstepRig):
    """A person switches the vehicle to OFFBOARD in the middle of a check."""

    switches_s = math.inf

    def tick(self) -> None:
        super().tick()
        if self.drone.time_s >= self.switches_s:
            copter_of(self.drone).mode = copter_of(self.drone).find_mode("OFFBOARD")
            self.switches_s = math.inf


def test_a_px4_that_enters_offboard_in_the_middle_of_a_check_is_brought_out_of_it() -> None:
    rig = LateOffboardRig("px4")
    rig.switch_on_failsafes()
    with rig, connected(rig) as vehicle:
        vehicle.attend(3.0)
        rig.switches_s = rig.now_s() + 1.0
        assert [item.name for item in vehicle.check() if not item.passed] == []
        assert rig.switches_s == math.inf
        assert vehicle.condition().mode == "Hold"


@pytest.mark.complete
def test_a_persons_land_always_goes_and_is_not_repeated_to_a_vehicle_whose_motors_stand() -> None:
    """What it says of its motors may be another's word; a PX4 is brought out of the mode again before it flies."""
    with ready("px4") as rig, connected(rig) as vehicle:
        vehicle.attend(3.0)
        told = len(rig.told("COMMAND_LONG"))
        vehicle.land("to be sure")
        vehicle.attend(4.0)
        assert len(rig.told("COMMAND_LONG")) - told <= 2
        assert [item.name for item in vehicle.check() if not item.passed] == []
        assert vehicle.condition().mode == "Hold"


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_whose_own_checks_fail_is_not_flown_and_all_reasons_are_reported(autopilot: str) -> None:
    with LockstepRig(autopilot, faults=["arm-refused@connect"]) as rig:
        rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            vehicle.attend(31.0)
            [own] = [item for item in vehicle.check() if item.name == "own_checks"]
            reason = {
                "ardupilot": "Need Position Estimate",
                "px4": "Preflight Fail: Arming denied: resolve system health failures first",
            }
            assert not own.passed
            assert reason[autopilot] in own.found


@pytest.mark.complete
@pytest.mark.parametrize("tells_events", [True, False])
def test_a_px4_that_would_not_arm_is_asked_what_keeps_it_from_that(tells_events: bool) -> None:
    """It sent them at its start, before anyone listened, and sends them again after a change or on request."""
    with LockstepRig("px4") as rig:
        if not tells_events:
            rig.drone.autopilot._send_check_events = lambda: None  # type: ignore[attr-defined]  # as before release 1.14
        with connected(rig) as vehicle:
            vehicle.attend(4.0)
            vehicle._radio.seen.arming_checks = Px4ArmingChecks()
            rig.drone.autopilot.refuses_arming = True
            [own] = [item for item in vehicle.check() if item.name == "own_checks"]
            messages = "messages: Preflight Fail: Arming denied: resolve system health failures first"
            failing = "failing: Local position estimate; " if tells_events else ""
            assert own.found.startswith(f"not passed; {failing}{messages}")
            assert own.hint.endswith("QGroundControl shows the reasons in full.")


def test_the_last_message_of_a_vehicle_has_its_age() -> None:
    with LockstepRig("px4") as rig, connected(rig) as vehicle:
        vehicle.attend(1.0)
        assert (vehicle.condition().said, vehicle.condition().said_age_s) == ("", None)
        long = "Preflight Fail: " + "Compass needs calibration, " * 3
        assert isinstance(rig.drone.autopilot, Px4)
        rig.drone.autopilot.send_text(long)
        for since_s in (2.0, 5.0):
            vehicle.attend(since_s)
        assert vehicle.condition().said == long
        assert vehicle.condition().said_age_s == pytest.approx(7.0, abs=0.5)


@pytest.mark.complete
def test_a_px4_that_does_not_leave_its_mode_reports_in_which_it_would_arm() -> None:
    with LockstepRig("px4") as rig, connected(rig) as vehicle:
        vehicle.attend(4.0)
        mode = next(each for each in rig.drone.autopilot.firmware.modes if each.name == "POSCTL")  # type: ignore[attr-defined]
        rig.drone.autopilot.mode = replace(mode, may_arm=False)  # type: ignore[attr-defined]
        rig.drone.autopilot.mode_refusal = lambda _mode: "not available"  # type: ignore[attr-defined]
        vehicle._radio.seen.arming_checks.take(
            VehicleEvent(ARMING_CHECK_SUMMARY, 900, struct.pack("<BIIII", 1, 0, 0, 1 << 4, 0))
        )
        vehicle.attend(1.0)
        [own] = [item for item in vehicle.check() if item.name == "own_checks"]
        assert "It can be armed in mode Hold." in own.hint


def test_parameters_of_a_copter_outlive_its_reboot_and_paparazzis_do_not() -> None:
    for autopilot, name, kept in (
        ("px4", "MPC_Z_P", True),
        ("ardupilot", "PSC_POSZ_P", True),
        ("paparazzi", "gui_v_kp", False),
    ):
        with LockstepRig(autopilot) as rig:
            before = rig.drone.autopilot.parameters[name]
            with closing(rig.link(target_system=rig.drone.autopilot.system)) as link:
                to = {"target_system": rig.drone.autopilot.system, "target_component": 0}
                link.send("PARAM_SET", **to, param_id=name, param_type=9, param_value=before + 1.0)
                rig.wait_s(0.2)
            rig.drone.reboot()
            assert rig.drone.autopilot.parameters[name] == before + (1.0 if kept else 0.0)


def test_a_vehicle_that_does_not_know_yet_where_it_is_is_waited_for_not_restarted() -> None:
    with ready("px4") as rig, connected(rig) as vehicle:
        rig.drone.autopilot.estimate_after_s = 60.0  # type: ignore[attr-defined]
        items = {item.name: item for item in vehicle.check()}
        for name in ("position", "clock", "still"):
            assert not items[name].passed
            assert items[name].hint.startswith("Wait until it has a position")
        assert items["clock"].found == "waiting for a position"


def test_a_text_that_comes_in_pieces_is_put_together() -> None:
    with ready("px4") as rig, connected(rig) as vehicle:
        words = "Preflight Fail: the heading estimate is not stable and the vehicle has moved since it was switched on"
        rig.drone.autopilot.send_text(words)  # type: ignore[attr-defined]
        vehicle.attend(0.5)
        assert vehicle.condition().said == words
