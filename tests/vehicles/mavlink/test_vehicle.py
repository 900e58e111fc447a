"""Whole trials against the simulated drone, which was built by another reading of the same facts."""

from pathlib import Path

import numpy as np
import pytest

from app.core.errors import InputError
from app.core.experiments.takeoff import Takeoff
from app.vehicles.base import (
    FlightOptions,
    FlightRecord,
    OptionValue,
    SafeGainsError,
    Sample,
    VehicleError,
)
from app.vehicles.flight_end import StopRequest
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mavlink_kind import MAVLINK
from app.vehicles.registry import open_vehicle
from tests.vehicles.flying import SAFE, TUNED, Watcher, never, unwatched
from tests.vehicles.mavlink.rigs import SAFE as OWN_SAFE
from tests.vehicles.mavlink.rigs import LockstepRig

ORDER = FlightOptions(seed=1, window_s=12.0)
TAKEOFF = Takeoff().configured({"window_s": 12.0})
"""A third of the usual time, in which every autopilot has settled."""


def fly(vehicle: MavlinkVehicle, gains: dict[str, float] | None = None) -> FlightRecord:
    vehicle.stage(TUNED if gains is None else gains)
    return vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)


def test_a_whole_trial_scores_as_the_same_body_does_without_a_link() -> None:
    with open_vehicle("twin", {"scatter": 0.0}, safe_gains=SAFE) as twin:
        twin.stage(TUNED)
        alone = TAKEOFF.error(twin.fly(ORDER, on_sample=unwatched, should_stop=never).trajectory)
    watcher = Watcher()
    with LockstepRig() as rig:
        vehicle = rig.vehicle()
        assert vehicle.read_gains() == SAFE
        assert vehicle.stage(TUNED) == TUNED
        record = vehicle.fly(ORDER, on_sample=watcher.see, should_stop=never)
        assert vehicle.read_gains() == SAFE
        vehicle.close()
    flight = record.trajectory
    assert (record.ending, record.reason, flight.source, flight.clock) == ("completed", "", "mavlink", "vehicle")
    assert TAKEOFF.error(flight) == pytest.approx(alone, rel=0.05)
    assert flight.time_s[0] == pytest.approx(-1.0, abs=0.1)
    assert 12.4 <= flight.time_s[-1] < 12.5
    assert 0.0 in flight.time_s
    assert np.diff(flight.time_s).max() < 0.03
    assert set(flight.channels) == {"altitude_m", "climb_rate_m_s", "set_point_m", "battery_v", "throttle"}
    assert len(watcher.samples) == pytest.approx(12.4 * 50, rel=0.05)


def test_a_window_that_the_flight_plan_would_cut_short_is_refused_on_the_ground() -> None:
    with LockstepRig() as rig:
        vehicle = rig.vehicle()
        vehicle.stage(TUNED)
        with pytest.raises(VehicleError, match=r"45 s or less: after it the flight plan lands it") as refusal:
            vehicle.fly(FlightOptions(seed=1, window_s=60.0), on_sample=unwatched, should_stop=never)
        assert refusal.value.not_flown
        assert vehicle.read_gains() == SAFE
        assert rig.drone.body.stands


@pytest.mark.parametrize(
    "error", [RuntimeError("the watcher's own"), pytest.param(KeyboardInterrupt(), marks=pytest.mark.complete)]
)
def test_what_would_end_the_program_lands_the_vehicle_first(error: BaseException) -> None:
    def fail(sample: Sample) -> None:
        if sample.time_s > 1.0:
            raise error

    with LockstepRig() as rig:
        vehicle = rig.vehicle()
        vehicle.stage(TUNED)
        with pytest.raises(type(error)):
            vehicle.fly(ORDER, on_sample=fail, should_stop=never)
        assert vehicle.read_gains() == SAFE
        assert rig.drone.body.stands
        vehicle.close()


def test_a_flight_aborted_before_it_starts_leaves_one_instant_and_arms_nothing() -> None:
    with LockstepRig() as rig:
        vehicle = rig.vehicle()
        vehicle.stage(TUNED)
        record = vehicle.fly(ORDER, on_sample=unwatched, should_stop=lambda: StopRequest("changed my mind"))
        assert (record.ending, record.reason, record.has_flown) == ("aborted", "changed my mind", False)
        assert record.trajectory.time_s.tolist() == [0.0]
        assert not rig.told("SCRIPT_ITEM")
        vehicle.close()


def test_nothing_flies_before_its_gains_are_staged() -> None:
    with LockstepRig() as rig:
        vehicle = rig.vehicle()
        with pytest.raises(VehicleError, match="No gains were staged"):
            vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)
        vehicle.close()


def test_without_a_heartbeat_nothing_is_sent() -> None:
    with LockstepRig(faults=["no-heartbeat@connect"]) as rig:
        with pytest.raises(VehicleError, match=r"Waited .* for Paparazzi\."):
            rig.vehicle()
        assert rig.heard == []


def test_another_system_than_the_one_named_is_not_listened_to() -> None:
    with LockstepRig() as rig, pytest.raises(VehicleError, match="Waited"):
        rig.vehicle(system_id=32.0)


def test_another_autopilot_is_not_flown() -> None:
    with LockstepRig("ardupilot") as rig:
        options = rig.options(autopilot="px4")
        with pytest.raises(VehicleError, match=r"^ArduCopter answers at .*, not PX4; nothing was sent\."):
            MavlinkVehicle(options, OWN_SAFE["px4"], is_real=False, clock=rig, transport=rig)


def test_a_position_that_comes_too_seldom_is_refused() -> None:
    with (
        LockstepRig(release="paparazzi-bare") as rig,
        pytest.raises(VehicleError, match=r"Position: .* per second, .* lost, required: 40"),
    ):
        rig.vehicle()


def test_an_armed_vehicle_is_met_with_quarantine() -> None:
    with LockstepRig() as rig:
        link = rig.link(target_system=31)
        for kind, fields in (("MISSION_ACK", {"type": 0}), ("SCRIPT_ITEM", {"seq": 3, "name": ""})):
            link.send(kind, target_system=31, target_component=0, **fields)
        link.close()
        with pytest.raises(SafeGainsError, match="somebody else armed it"):
            rig.vehicle()


@pytest.mark.parametrize(
    ("options", "is_simulated"),
    [
        ({"simulated": True}, True),
        ({"simulated": False}, False),
        ({"simulated": True, "address": "udpin:127.0.0.1:14550"}, True),
        ({"simulated": False, "address": "tcp:192.168.1.1:5760"}, False),
    ],
)
def test_only_what_is_said_to_be_simulated_and_is_here_is_no_real_vehicle(
    options: dict[str, OptionValue], is_simulated: bool
) -> None:
    complete = MAVLINK.check(options, field="options")
    assert MAVLINK.is_real_with(complete) is not is_simulated


def test_what_runs_on_the_administrators_simulation_hosts_is_no_real_vehicle() -> None:
    hosts, options = frozenset({"10.0.0.2"}), {"simulated": True, "address": "udp:10.0.0.2:4245@4244"}
    complete = MAVLINK.check(options, field="options", simulation_hosts=hosts)
    assert MAVLINK.is_real_with(complete)
    assert not MAVLINK.is_real_with(complete, hosts)
    assert MAVLINK.is_real_with({**complete, "simulated": False}, hosts)
    assert MAVLINK.is_real_with({**complete, "address": "udp:10.0.0.3:4245"}, hosts)


def test_a_vehicle_that_does_not_sign_is_not_heard_where_signatures_are_wanted(tmp_path: Path) -> None:
    key = tmp_path / "key.txt"
    key.write_text("3f" * 32 + "\n", encoding="ascii")
    with LockstepRig("ardupilot") as rig, pytest.raises(VehicleError, match="Waited"):
        rig.vehicle(signing_key_file=str(key))


def test_an_unreadable_signing_key_is_refused_without_being_quoted() -> None:
    with LockstepRig("ardupilot") as rig, pytest.raises(InputError, match="signing key") as refusal:
        rig.vehicle(signing_key_file="nowhere/secret.txt")
    assert "secret" not in f"{refusal.value} {refusal.value.problems}"


@pytest.mark.parametrize(
    ("options", "field", "reason"),
    [
        ({"signing_key_file": "key.txt"}, "signing_key_file", "Paparazzi uses MAVLink 1"),
        ({"scored_source": "gps"}, "scored_source", "must be vehicle or mocap, got gps"),
        ({"scored_source": "mocap"}, "scored_source", "needs a second source"),
        ({"second_source": "camera"}, "second_source", "must be natnet:HOST?body=ID"),
        (
            {"simulated": True, "address": "udp:10.0.0.2:4245@4244"},
            "simulated",
            "must be off for udp:10.0.0.2:4245@4244",
        ),
        ({"address": "udp:127.0.0.1:4265"}, "address", "must name the port of this computer that Paparazzi sends to"),
        (
            {"simulated": True, "address": "serial:/dev/ttyUSB0:57600"},
            "simulated",
            "a simulation has the address 127.0.0.1",
        ),
        ({"autopilot": "betaflight"}, "autopilot", "must be paparazzi, ardupilot, px4"),
        ({"address": "nowhere"}, "address", "must be udp:"),
        ({"clock_speed": 10.0}, "clock_speed", "must be 1"),
    ],
)
def test_impossible_options_are_refused_by_name(options: dict[str, OptionValue], field: str, reason: str) -> None:
    with pytest.raises(InputError) as refusal:
        MAVLINK.check(options, field="vehicle.options")
    [problem] = refusal.value.problems
    assert problem.field == f"vehicle.options.{field}"
    assert reason in problem.reason


MILDER = {
    "ardupilot": {"PSC_POSZ_P": 1.5, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.37, "PSC_ACCZ_D": 0.0, "PSC_ACCZ_I": 1.1},
    "px4": {"MPC_Z_P": 1.2, "MPC_Z_VEL_P_ACC": 6.1, "MPC_Z_VEL_D_ACC": 0.0, "MPC_Z_VEL_I_ACC": 1.7},
}


@pytest.mark.parametrize(
    ("autopilot", "release"),
    [
        ("ardupilot", ""),
        pytest.param("ardupilot", "ardupilot-4.7", marks=pytest.mark.complete),
        ("px4", ""),
    ],
)
def test_the_other_autopilots_fly_a_trial_with_gains_of_their_own(autopilot: str, release: str) -> None:
    safe, gains = OWN_SAFE[autopilot], MILDER[autopilot]
    with LockstepRig(autopilot, release=release) as rig:
        rig.switch_on_failsafes()
        vehicle = rig.vehicle()
        assert vehicle.stage(gains) == gains
        assert vehicle.read_gains() == gains
        record = vehicle.fly(ORDER, on_sample=unwatched, should_stop=never)
        assert vehicle.read_gains() == safe
        vehicle.close()
    flight = record.trajectory
    assert (record.ending, record.reason) == ("completed", "")
    assert 0.8 < TAKEOFF.error(flight) < 1.5, "spool-up and ramp take 4 to 5 s, in which 3 m are missing"
    before, settled = flight.time_s < 0.0, flight.time_s > 10.0
    np.testing.assert_allclose(flight["altitude_m"][before], 0.0, atol=0.1)
    np.testing.assert_allclose(flight["altitude_m"][settled], 3.0, atol=0.2)


@pytest.mark.parametrize(("autopilot", "named"), [("ardupilot", "FS_GCS_ENABLE"), ("px4", "NAV_DLL_ACT")])
def test_a_vehicle_whose_failsafes_are_off_is_not_flown(autopilot: str, named: str) -> None:
    with LockstepRig(autopilot) as rig, pytest.raises(VehicleError, match=f"Failsafe {named}: 0, required: "):
        rig.vehicle()


@pytest.mark.complete
def test_a_link_that_breaks_here_leaves_the_vehicle_to_its_own_failsafe_and_in_quarantine() -> None:
    with LockstepRig() as rig:
        vehicle = rig.vehicle()
        vehicle.stage(TUNED)

        def cut(sample: Sample) -> None:
            if sample.time_s > 1.0:
                vehicle.close()

        record = vehicle.fly(ORDER, on_sample=cut, should_stop=never)
        assert (record.ending, rig.drone.body.stands) == ("invalid", True)
        with pytest.raises(SafeGainsError, match="Nothing is written"):
            vehicle.stage(SAFE)
