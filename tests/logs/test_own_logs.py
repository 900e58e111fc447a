"""A flight's telemetry log, begun after the connection, gives the flight back that our own vehicle recorded."""

import io
from pathlib import Path

import numpy as np
import pytest

from app.autopilots.log_readers import read_takeoff
from app.vehicles.base import FlightOptions
from tests.vehicles.flying import TAKEOFF, never, unwatched
from tests.vehicles.mavlink.rigs import SAFE, LockstepRig

ONE_SAMPLE_M = 0.002
"""What 20 ms more or less under a set point of 3 m make of the error over 32.6 s: the sample that is in the log before
the command may not have been looked at by the ground yet when it sent that."""

COMMANDS = {"paparazzi": "the block Takeoff", "ardupilot": "the command NAV_TAKEOFF", "px4": "the command DO_SET_MODE"}


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", ["paparazzi", "ardupilot", "px4"])
def test_the_log_of_a_flight_is_the_flight(autopilot: str, tmp_path: Path) -> None:
    gains = dict(SAFE[autopilot])
    first = next(iter(gains))
    gains[first] *= 1.25 if autopilot != "paparazzi" else 2
    with LockstepRig(autopilot) as rig:
        if autopilot != "paparazzi":
            rig.switch_on_failsafes()
        vehicle = rig.vehicle()
        vehicle.log_to(tmp_path / "flight.tlog")
        vehicle.stage(gains)
        record = vehicle.fly(FlightOptions(seed=1), on_sample=unwatched, should_stop=never)
        vehicle.close()
    flown = read_takeoff(io.BytesIO((tmp_path / "flight.tlog").read_bytes()))
    assert flown.begins_with == COMMANDS[autopilot]
    assert flown.gains == pytest.approx(gains)
    assert TAKEOFF.error(flown.trajectory) == pytest.approx(TAKEOFF.error(record.trajectory), abs=ONE_SAMPLE_M)
    assert len(flown.trajectory) == pytest.approx(len(record.trajectory), abs=100)
    altitude_m = np.interp(record.trajectory.time_s, flown.trajectory.time_s, flown.trajectory["altitude_m"])
    assert np.abs(altitude_m - record.trajectory["altitude_m"]).max() < 0.1
