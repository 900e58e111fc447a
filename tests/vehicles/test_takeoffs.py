"""What every vehicle that takes off must do beyond the contract of all vehicles."""

from collections.abc import Iterator
from typing import Final

import numpy as np
import pytest

from app.core.control.vertical_guidance import ALT, LEVEL, Z_REF, measured, new_state, step
from app.core.errors import GainsError
from app.core.models.set_points import SetPoints
from app.vehicles.base import FlightOptions, Vehicle
from app.vehicles.kernels import CHANNELS
from app.vehicles.registry import VEHICLE_KINDS, open_vehicle
from tests.vehicles.flying import SAFE, TAKES_OFF, TUNED, Watcher, fly, never, unwatched

SLICE_STEPS: Final = 11
"""20 ms at 512 Hz, rounded up."""

pytestmark = pytest.mark.parametrize("kind", TAKES_OFF)


@pytest.fixture
def vehicle(kind: str) -> Iterator[Vehicle]:
    with open_vehicle(kind, {}, safe_gains=SAFE) as opened:
        yield opened


def test_gains_outside_the_experiments_bounds_can_be_staged(kind: str, vehicle: Vehicle) -> None:
    """The paper flew ki = 1356; the gate guards campaigns, not the vehicle."""
    assert vehicle.stage({"kp": 1624, "ki": 1356, "kd": 195}) == {"kp": 1624, "ki": 1356, "kd": 195}


@pytest.mark.parametrize(
    ("gains", "field"),
    [
        ({"kp": 283, "ki": 13}, "gains.kd"),
        ({"kp": 283.5, "ki": 13, "kd": 82}, "gains.kp"),
        ({"kp": 283, "ki": float("nan"), "kd": 82}, "gains.ki"),
        ({"kp": 2**31, "ki": 13, "kd": 82}, "gains.kp"),
        ({"kp": 10**400, "ki": 13, "kd": 82}, "gains.kp"),
        ({"kp": 283, "ki": 13, "kd": 82, "kx": 1}, "gains.kx"),
    ],
)
def test_gains_that_the_vehicle_cannot_hold_are_refused_and_change_nothing(
    kind: str, vehicle: Vehicle, gains: dict[str, float], field: str
) -> None:
    with pytest.raises(GainsError) as refusal:
        vehicle.stage(gains)
    assert [problem.field for problem in refusal.value.problems] == [field]
    assert vehicle.read_gains() == SAFE


def test_a_flight_leaves_every_channel_at_512_hz_from_the_command_past_the_scored_window(
    kind: str, vehicle: Vehicle
) -> None:
    record = fly(vehicle)
    flight = record.trajectory
    assert (record.ending, record.reason) == ("completed", "")
    assert record.settings.keys() == {option.name for option in VEHICLE_KINDS[kind].options}
    assert (flight.source, flight.clock) == (kind, "simulation")
    assert set(flight.channels) == set(CHANNELS)
    assert all(
        values.shape == flight.time_s.shape and values.dtype == np.float64 for values in flight.channels.values()
    )
    assert flight.time_s[0] == 0.0
    np.testing.assert_allclose(np.diff(flight.time_s), 1 / 512, rtol=1e-12)
    assert flight.time_s[-1] >= 32.6


@pytest.mark.complete
@pytest.mark.parametrize("window_s", [10.0, 20.25])
def test_a_flight_with_another_window_is_the_same_and_lasts_as_long_as_that_needs(
    kind: str, vehicle: Vehicle, window_s: float
) -> None:
    whole = fly(vehicle).trajectory
    vehicle.stage(TUNED)
    order = FlightOptions(seed=1, window_s=window_s)
    chosen = vehicle.fly(order, on_sample=unwatched, should_stop=never).trajectory
    assert chosen.time_s[-1] == pytest.approx(window_s + 0.4, abs=1 / 512)
    assert np.array_equal(chosen["altitude_m"], whole["altitude_m"][: len(chosen)])


def test_later_set_points_are_commanded_at_their_steps_even_between_telemetry(kind: str, vehicle: Vehicle) -> None:
    """The reference of a loop of its own, fed with the same targets and entered with the flight's, is the same."""
    vehicle.stage(TUNED)
    order = FlightOptions(seed=1, window_s=12.0, set_points=SetPoints((0.0, 5.123046875, 9.0), (2.5, 1.75, 3.0)))
    flight = vehicle.fly(order, on_sample=unwatched, should_stop=never).trajectory
    changes = np.flatnonzero(np.diff(flight["set_point_m"])) + 1
    assert changes.tolist() == [2623, 4608]
    assert flight["set_point_m"][[0, 2622, 2623, 4607, 4608]].tolist() == [2.5, 2.5, 1.75, 1.75, 3.0]
    entered, reference = int(np.argmax(flight["thrust"] > 0.0)), []
    state = new_state(measured(-flight["altitude_m"][entered], 8), measured(-flight["climb_rate_m_s"][entered], 19))
    for target in flight["set_point_m"][entered:]:
        step(state, ALT, int(target * 256), 0, 0, 0, 0, 0, LEVEL, True)
        reference.append(-state[Z_REF] / 256)
    assert flight["reference_m"][entered:].tolist() == reference


def test_altitude_points_up_from_the_ground_to_3_m(kind: str, vehicle: Vehicle) -> None:
    flight = fly(vehicle).trajectory
    altitude = flight["altitude_m"]
    assert altitude[0] == pytest.approx(0.0, abs=0.02)
    assert altitude[-512:] == pytest.approx(np.full(512, 3.0), abs=0.05)
    assert altitude.min() > -0.05
    assert altitude.max() < 3.5
    np.testing.assert_array_equal(flight["set_point_m"], 3.0)
    assert flight["reference_m"][-1] == pytest.approx(3.0, abs=0.01)


def test_channels_are_in_their_units(kind: str, vehicle: Vehicle) -> None:
    flight = fly(vehicle).trajectory
    climbed = np.trapezoid(flight["climb_rate_m_s"], flight.time_s)
    assert climbed == pytest.approx(flight["altitude_m"][-1] - flight["altitude_m"][0], abs=0.03)
    assert flight["thrust"].min() >= 0.0
    assert flight["thrust"].max() <= 1.0
    assert flight["thrust"][-512:].mean() == pytest.approx(0.62, abs=0.02)
    parts = np.clip(flight["feed_forward"] + flight["feedback"], 0.0, 1.0)
    np.testing.assert_allclose(flight["thrust"], parts, atol=1e-12)
    assert 9.0 < flight["battery_v"].min() <= flight["battery_v"].max() < 13.0


@pytest.mark.parametrize("speed", [None, 20.0])
def test_an_abort_ends_the_flight_within_20_ms_of_vehicle_time(
    kind: str, vehicle: Vehicle, speed: float | None
) -> None:
    watcher = Watcher(abort_at_s=2.0)
    record = fly(vehicle, speed=speed, on_sample=watcher.see, should_stop=watcher.decide)
    flight = record.trajectory
    asked = int(np.searchsorted(flight.time_s, watcher.samples[-1].time_s))
    given_up = int(np.argmax(flight["set_point_m"] == 0.0))
    assert (record.ending, record.reason) == ("aborted", "the operator pressed Abort")
    assert asked < given_up <= asked + SLICE_STEPS
    assert watcher.samples[-1].time_s == pytest.approx(2.0, abs=0.02)


@pytest.mark.complete
def test_an_aborted_flight_lands_on_its_safe_gains_and_keeps_its_record(kind: str, vehicle: Vehicle) -> None:
    watcher = Watcher(abort_at_s=8.0)
    flight = fly(vehicle, on_sample=watcher.see, should_stop=watcher.decide).trajectory
    whole = fly(vehicle).trajectory
    until = int(np.argmax(flight["set_point_m"] == 0.0))
    np.testing.assert_array_equal(flight["altitude_m"][:until], whole["altitude_m"][:until])
    assert -1.5 < flight["climb_rate_m_s"][until:].min() < -0.3
    assert flight["altitude_m"][-1] < 0.05
    assert (np.diff(flight.time_s) > 0.0).all()
    assert vehicle.read_gains() == SAFE


@pytest.mark.parametrize(("abort_at_s", "has_flown"), [(0.02, False), (1.0, True)])
def test_a_flight_aborted_before_the_vehicle_has_risen_is_none(
    kind: str, vehicle: Vehicle, abort_at_s: float, has_flown: bool
) -> None:
    watcher = Watcher(abort_at_s=abort_at_s)
    record = fly(vehicle, on_sample=watcher.see, should_stop=watcher.decide)
    assert (record.ending, record.has_flown) == ("aborted", has_flown)
    assert (record.trajectory["altitude_m"].max() > 0.02) == has_flown
