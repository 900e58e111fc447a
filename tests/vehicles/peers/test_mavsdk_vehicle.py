"""The program's ground side with MAVSDK's independent vehicle, over real UDP, by the vehicle's clock."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from app.autopilots.registry import AUTOPILOTS
from app.vehicles import mavlink_kind
from app.vehicles.base import RECORDED_BEYOND_S, FlightOptions, OptionValue, Vehicle, VehicleError
from app.vehicles.mavlink import radio
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mavlink_kind import MAVLINK
from app.vehicles.registry import open_vehicle
from tests.ports import free_port
from tests.vehicles.flying import never, unwatched
from tests.vehicles.peers.mavsdk_vehicle import FLOATS, INTEGERS, MAKE, MavsdkVehicle, StepClock
from tests.vehicles.peers.mavsdk_vehicle import GAINS as SAFE
from tests.waiting import eventually

pytestmark = pytest.mark.real_time("MAVSDK's heartbeats are of the clock on the wall", about_s=15)

TUNED = {"MPC_Z_P": 1.25, "MPC_Z_VEL_P_ACC": 6.1, "MPC_Z_VEL_D_ACC": 0.05, "MPC_Z_VEL_I_ACC": 1.7}
RECORD_S = 6.0
ORDER = FlightOptions(seed=1, window_s=RECORD_S - RECORDED_BEYOND_S)
"""The record is shorter, because its time passes on the wall."""


@pytest.fixture(autouse=True)
def generic_autopilot(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that differs from PX4 is the make in the heartbeat."""
    generic = replace(AUTOPILOTS["px4"], autopilot=MAKE)
    monkeypatch.setattr(radio, "AUTOPILOTS", {**AUTOPILOTS, "px4": generic})


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> StepClock:
    """Of both sides."""
    shared = StepClock()
    monkeypatch.setattr(mavlink_kind, "ScaledClock", lambda _speed: shared)
    return shared


def options_at(port: int) -> dict[str, OptionValue]:
    return {"autopilot": "px4", "address": f"udpin:127.0.0.1:{port}", "simulated": True}


@contextmanager
def met(clock: StepClock, *, armable: bool = True) -> Iterator[tuple[MavsdkVehicle, Vehicle]]:
    """MAVSDK's vehicle, and what we make of it once its positions arrive: a busy machine loses some of the first."""
    port = free_port()
    opened = partial(open_vehicle, "mavlink", options_at(port), safe_gains=SAFE)
    with MavsdkVehicle(port, clock, armable=armable) as peer, opened() as ours:
        assert isinstance(ours, MavlinkVehicle)
        eventually(lambda: all(item.passed for item in ours.check() if item.name == "position"))
        yield peer, ours


@pytest.mark.complete
def test_mavsdks_vehicle_takes_gains_flies_a_trial_and_has_its_safe_gains_back(clock: StepClock) -> None:
    with met(clock) as (peer, ours):
        assert ours.stage(TUNED) == TUNED
        record = ours.fly(ORDER, on_sample=unwatched, should_stop=never)
        assert ours.read_gains() == SAFE
        assert (peer.flew_with, peer.gains, peer.stands) == ([TUNED], SAFE, True)
    flight = record.trajectory
    assert (record.ending, record.reason) == ("completed", "")
    assert (flight.time_s[0], flight.time_s[-1]) == pytest.approx((-1.0, RECORD_S), abs=0.2)
    np.testing.assert_allclose(flight["altitude_m"][flight.time_s < 0.0], 0.0, atol=1e-3)
    assert flight["altitude_m"][-1] == pytest.approx(3.0, abs=0.05)
    assert flight["climb_rate_m_s"].max() == pytest.approx(1.5)
    np.testing.assert_allclose(flight["battery_v"], 12.3)


@pytest.mark.complete
def test_mavsdks_vehicle_that_will_not_arm_is_left_on_the_ground_with_its_safe_gains(
    clock: StepClock,
) -> None:
    with met(clock, armable=False) as (peer, ours):
        ours.stage(TUNED)
        with pytest.raises(VehicleError) as refusal:
            ours.fly(ORDER, on_sample=unwatched, should_stop=never)
        assert refusal.value.not_flown
        assert (peer.flew_with, peer.gains, peer.stands) == ([], SAFE, True)


@pytest.mark.complete
def test_mavsdks_vehicle_passes_every_check_and_tells_all_its_parameters(tmp_path: Path, clock: StepClock) -> None:
    port = free_port()
    assert MAVLINK.connect is not None
    with MavsdkVehicle(port, clock):
        options = MAVLINK.check(options_at(port), field="options")
        ours = MAVLINK.connect(options, SAFE, tmp_path / "parameters.json", None, lambda: None, False)
        try:
            assert (ours.identity.system_id, ours.concern) == (1, "")
            assert {item.title: item.found for item in ours.check() if not item.passed} == {}
            told = ours.parameters()
        finally:
            ours.close()
    assert told == pytest.approx({**FLOATS, **INTEGERS})
