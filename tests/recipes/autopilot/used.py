"""The autopilot is offered, and its simulated counterpart is tuned and flown over a link, in time of its own."""

import pytest

from app.campaigns.catalogue import get_catalogue
from app.vehicles.base import FlightOptions
from tests.vehicles.flying import never, unwatched
from tests.vehicles.mavlink.rigs import LockstepRig

SAFE, TUNED = {"kp": 283.0, "ki": 13.0, "kd": 82.0}, {"kp": 400.0, "ki": 20.0, "kd": 90.0}


def test_it_is_offered() -> None:
    [toy] = [each for each in get_catalogue().autopilots if each.name == "toy"]
    assert (toy.experiments, toy.address) == (["takeoff"], "udpin:127.0.0.1:14550")


def test_it_is_tuned_and_flown() -> None:
    with LockstepRig("toy") as rig:
        vehicle = rig.vehicle(SAFE)
        assert [item.name for item in vehicle.check() if not item.passed] == []
        assert vehicle.stage(TUNED) == TUNED
        on_board = rig.drone.autopilot.parameters["TOY_P"]
        assert on_board == pytest.approx(0.2, rel=1e-6)  # 400 · 0.0005, in single precision
        record = vehicle.fly(FlightOptions(seed=1, window_s=12.0), on_sample=unwatched, should_stop=never)
        assert vehicle.read_gains() == SAFE
        assert not rig.drone.autopilot.armed
        vehicle.close()
    flown = record.trajectory
    assert (record.ending, record.reason) == ("completed", "")
    # the takeoff's altitude, with a slow integrator
    assert flown["altitude_m"][flown.time_s > 10.0].mean() == pytest.approx(3.0, abs=0.3)
