"""Whole flights with motion capture, at eight times real time: NatNet is received in a separate thread."""

import threading
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from app.core.records.glitches import find_glitches
from app.vehicles.base import FlightRecord, OptionValue, VehicleError
from app.vehicles.mavlink_kind import MAVLINK
from tests.ports import free_port
from tests.vehicles.flying import SAFE
from tests.vehicles.mavlink.rigs import LockstepRig, UdpRig
from tests.vehicles.mavlink.test_vehicle import TAKEOFF, fly

pytestmark = pytest.mark.real_time("cameras are received in a thread of their own, over real UDP", about_s=10)


def natnet(port: int) -> str:
    return f"natnet:127.0.0.1?body=4&multicast=no&command_port={port}"


def flown(mocap: str, faults: Sequence[str] = (), **options: OptionValue) -> FlightRecord:
    """And landed with its safe gains, whatever happened."""
    with UdpRig(faults=faults, mocap=mocap) as rig:
        vehicle = rig.vehicle(second_source=mocap, **options)
        record = fly(vehicle)
        assert (vehicle.concern, vehicle.read_gains()) == ("", SAFE)
        assert rig.drone.body.stands
        vehicle.close()
    return record


@pytest.mark.complete
def test_cameras_are_recorded_beside_the_vehicle_aligned_and_in_agreement() -> None:
    record = flown(natnet(free_port()))
    assert (record.ending, record.reason) == ("completed", "")
    both = record.trajectory
    np.testing.assert_allclose(both["altitude_2_m"], both["altitude_m"], atol=0.1)
    assert 0.0 < float(record.settings["second_delay_s"]) < 0.25
    assert float(record.settings["second_rms_m"]) < 0.02
    assert not find_glitches(TAKEOFF, both)


@pytest.mark.complete
def test_cameras_can_be_the_ones_that_are_scored() -> None:
    record = flown(natnet(free_port()), scored_source="mocap")
    both = record.trajectory
    assert (record.ending, record.reason) == ("completed", "")
    assert 1.0 / np.median(np.diff(both.time_s)) == pytest.approx(100.0, rel=0.2)
    own = replace(both, channels={**both.channels, "altitude_m": both["altitude_2_m"]})
    assert TAKEOFF.error(both) == pytest.approx(TAKEOFF.error(own), rel=0.02)


@pytest.mark.complete
def test_odometry_on_the_vehicle_s_own_link_is_a_second_source_too() -> None:
    with LockstepRig(mocap="odometry") as rig:
        vehicle = rig.vehicle(second_source="odometry")
        record = fly(vehicle)
        vehicle.close()
    assert (record.ending, record.reason) == ("completed", "")
    np.testing.assert_allclose(record.trajectory["altitude_2_m"], record.trajectory["altitude_m"], atol=0.1)


@pytest.mark.complete
@pytest.mark.parametrize("fault", ["mocap-lost@4", "mocap-frozen@4"])
def test_cameras_that_see_nothing_new_land_the_vehicle_and_void_the_flight(fault: str) -> None:
    record = flown(natnet(free_port()), [fault])
    assert (record.ending, record.end.failure) == ("invalid", "F9a")
    assert "Rigid body 4 of the motion capture at 127.0.0.1 has no samples for" in record.reason
    assert 4.0 < record.trajectory.time_s[-1] < 25.0


@pytest.mark.complete
def test_cameras_that_do_not_see_the_vehicle_on_the_ground_refuse_the_flight() -> None:
    mocap = natnet(free_port())
    with UdpRig(mocap=mocap) as rig:
        vehicle = rig.vehicle(second_source=mocap)
        rig.drone.cameras.blind = True
        with pytest.raises(VehicleError, match="Second source of altitude: The cameras do not see rigid body 4 of"):
            fly(vehicle)
        vehicle.close()


@pytest.mark.complete
def test_the_source_is_let_go_when_the_vehicle_cannot_be_opened() -> None:
    mocap = natnet(free_port())
    with UdpRig(mocap=mocap) as rig:
        options = {**rig.options(second_source=mocap), "system_id": 99.0}
        with pytest.raises(VehicleError):
            MAVLINK.open(options, SAFE, None)
        assert not any(thread.name.startswith("natnet:") for thread in threading.enumerate())
