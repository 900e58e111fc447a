"""What every vehicle that can fly must do. A new kind is covered as soon as it is registered."""

import time
from collections.abc import Iterator
from typing import Final

import numpy as np
import pytest

from app.core.errors import GainsError, InputError
from app.core.trajectory import CHANNEL_UNITS, Trajectory
from app.vehicles.base import FlightOrder, OptionValue, Sample, Vehicle
from app.vehicles.errors import VehicleError
from app.vehicles.open import VEHICLE_KINDS, open_vehicle
from tests.vehicles.flying import CAN_FLY, SAFE, TAKEOFF, TUNED, Watcher, flown, fly, never, unwatched

SCATTERED: Final[dict[str, dict[str, OptionValue]]] = {
    "jsbsim": {"gust_m_s": 0.5, "altitude_noise_m": 0.005},
    "twin": {"scatter": 1.0},
}
SLICE_STEPS: Final = 11
"""20 ms at 512 Hz, rounded up."""

pytestmark = pytest.mark.parametrize("kind", CAN_FLY)


@pytest.fixture
def vehicle(kind: str) -> Iterator[Vehicle]:
    with open_vehicle(kind, {}, safe_gains=SAFE) as opened:
        yield opened


def same(one: Trajectory, other: Trajectory) -> bool:
    return np.array_equal(one.time_s, other.time_s) and all(
        np.array_equal(values, other[name]) for name, values in one.channels.items()
    )


def test_a_vehicle_says_what_it_is(kind: str, vehicle: Vehicle) -> None:
    assert vehicle.kind == kind
    assert vehicle.is_real == VEHICLE_KINDS[kind].is_real
    assert vehicle.safe_gains == SAFE


def test_an_opened_vehicle_holds_its_safe_gains(kind: str, vehicle: Vehicle) -> None:
    assert vehicle.read_gains() == SAFE


def test_staged_gains_are_read_back_and_held(kind: str, vehicle: Vehicle) -> None:
    assert vehicle.stage(TUNED) == TUNED
    assert vehicle.read_gains() == TUNED


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


def test_nothing_flies_before_its_gains_are_staged(kind: str, vehicle: Vehicle) -> None:
    with pytest.raises(VehicleError, match="No gains were staged"):
        vehicle.fly(FlightOrder(seed=1), on_sample=unwatched, should_abort=never)


def test_gains_are_staged_anew_for_every_flight(kind: str, vehicle: Vehicle) -> None:
    fly(vehicle)
    assert vehicle.read_gains() == SAFE
    with pytest.raises(VehicleError, match="No gains were staged"):
        vehicle.fly(FlightOrder(seed=1), on_sample=unwatched, should_abort=never)


def test_a_flight_leaves_every_channel_at_512_hz_from_the_command_past_the_scored_window(
    kind: str, vehicle: Vehicle
) -> None:
    record = fly(vehicle)
    flight = record.trajectory
    assert (record.ending, record.reason) == ("completed", "")
    assert record.settings.keys() == {option.name for option in VEHICLE_KINDS[kind].options}
    assert (flight.source, flight.clock) == (kind, "simulation")
    assert set(flight.channels) == set(CHANNEL_UNITS)
    assert all(
        values.shape == flight.time_s.shape and values.dtype == np.float64 for values in flight.channels.values()
    )
    assert flight.time_s[0] == 0.0
    np.testing.assert_allclose(np.diff(flight.time_s), 1 / 512, rtol=1e-12)
    assert flight.time_s[-1] >= 32.6


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


def test_a_flight_can_be_scored_before_and_after_storage(kind: str, vehicle: Vehicle) -> None:
    flight = fly(vehicle).trajectory
    assert TAKEOFF.error(flight) == pytest.approx(TAKEOFF.error(flight.as_stored()), abs=1e-6)
    assert 0.08 < TAKEOFF.error(flight) < 0.15


def test_the_same_seed_gives_the_same_flight(kind: str) -> None:
    assert same(flown(kind, SCATTERED[kind], seed=7), flown(kind, SCATTERED[kind], seed=7))


def test_another_seed_gives_another_flight(kind: str) -> None:
    assert not same(flown(kind, SCATTERED[kind], seed=7), flown(kind, SCATTERED[kind], seed=8))


def test_flights_of_one_vehicle_do_not_depend_on_those_before(kind: str) -> None:
    with open_vehicle(kind, SCATTERED[kind], safe_gains=SAFE) as vehicle:
        fly(vehicle, SAFE, seed=3)
        later = fly(vehicle, seed=7).trajectory
    assert same(later, flown(kind, SCATTERED[kind], seed=7))


def test_telemetry_comes_at_50_hz_and_agrees_with_the_record(kind: str, vehicle: Vehicle) -> None:
    watcher = Watcher()
    flight = fly(vehicle, on_sample=watcher.see).trajectory
    times = np.array([sample.time_s for sample in watcher.samples])
    assert len(times) == pytest.approx(flight.time_s[-1] * 50, abs=2)
    np.testing.assert_allclose(np.diff(times), 0.02, atol=1 / 512)
    for sample in (watcher.samples[1], watcher.samples[200], watcher.samples[-1]):
        row = int(np.searchsorted(flight.time_s, sample.time_s))
        told = (sample.altitude_m, sample.climb_rate_m_s, sample.set_point_m, sample.reference_m, sample.thrust,
                sample.battery_v)  # fmt: skip
        recorded = ("altitude_m", "climb_rate_m_s", "set_point_m", "reference_m", "thrust", "battery_v")
        assert told == tuple(flight[name][row] for name in recorded)


def test_a_watched_flight_never_runs_ahead_of_its_pace(kind: str, vehicle: Vehicle) -> None:
    """Only lower bounds: a busy machine may be late, but computing ahead and playing back would be early."""
    speed, start_s = 60.0, time.monotonic()
    seen: list[tuple[float, float]] = []

    def watch(sample: Sample) -> None:
        seen.append((time.monotonic() - start_s, sample.time_s))

    flight = fly(vehicle, speed=speed, on_sample=watch).trajectory
    assert time.monotonic() - start_s >= flight.time_s[-1] / speed
    assert all(wall_s >= time_s / speed for wall_s, time_s in seen)


def test_the_pace_does_not_change_the_flight(kind: str, vehicle: Vehicle) -> None:
    assert same(fly(vehicle, speed=100.0).trajectory, fly(vehicle).trajectory)


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_pace_is_refused_and_the_safe_gains_are_back(kind: str, vehicle: Vehicle, speed: float) -> None:
    with pytest.raises(InputError) as refusal:
        fly(vehicle, speed=speed)
    assert refusal.value.problems[0].field == "speed"
    assert vehicle.read_gains() == SAFE


@pytest.mark.parametrize("speed", [None, 20.0])
def test_an_abort_ends_the_flight_within_20_ms_of_vehicle_time(
    kind: str, vehicle: Vehicle, speed: float | None
) -> None:
    watcher = Watcher(abort_at_s=2.0)
    record = fly(vehicle, speed=speed, on_sample=watcher.see, should_abort=watcher.decide)
    flight = record.trajectory
    asked = int(np.searchsorted(flight.time_s, watcher.samples[-1].time_s))
    given_up = int(np.argmax(flight["set_point_m"] == 0.0))
    assert (record.ending, record.reason) == ("aborted", "the operator pressed Abort")
    assert asked < given_up <= asked + SLICE_STEPS
    assert watcher.samples[-1].time_s == pytest.approx(2.0, abs=0.02)


def test_an_aborted_flight_lands_on_its_safe_gains_and_keeps_its_record(kind: str, vehicle: Vehicle) -> None:
    watcher = Watcher(abort_at_s=8.0)
    flight = fly(vehicle, on_sample=watcher.see, should_abort=watcher.decide).trajectory
    whole = fly(vehicle).trajectory
    until = int(np.argmax(flight["set_point_m"] == 0.0))
    np.testing.assert_array_equal(flight["altitude_m"][:until], whole["altitude_m"][:until])
    assert -1.5 < flight["climb_rate_m_s"][until:].min() < -0.3
    assert flight["altitude_m"][-1] < 0.05
    assert (np.diff(flight.time_s) > 0.0).all()
    assert vehicle.read_gains() == SAFE


def test_a_flight_aborted_before_it_starts_leaves_one_instant_on_the_ground(kind: str, vehicle: Vehicle) -> None:
    record = fly(vehicle, should_abort=lambda: "changed my mind")
    assert (record.ending, record.reason) == ("aborted", "changed my mind")
    assert record.trajectory.time_s.tolist() == [0.0]
    assert record.trajectory["thrust"].tolist() == [0.0]


def test_the_safe_gains_are_restored_on_exit(kind: str) -> None:
    with open_vehicle(kind, {}, safe_gains=SAFE) as vehicle:
        vehicle.stage(TUNED)
    assert vehicle.read_gains() == SAFE


def test_the_safe_gains_are_restored_when_the_caller_fails(kind: str) -> None:
    held: list[Vehicle] = []

    def leave_badly() -> None:
        with open_vehicle(kind, {}, safe_gains=SAFE) as vehicle:
            held.append(vehicle)
            vehicle.stage(TUNED)
            raise RuntimeError("the caller's own")

    with pytest.raises(RuntimeError, match="the caller's own"):
        leave_badly()
    assert held[0].read_gains() == SAFE


def test_the_safe_gains_are_restored_when_a_watcher_fails_in_flight(kind: str, vehicle: Vehicle) -> None:
    def fail(sample: Sample) -> None:
        if sample.time_s > 1.0:
            raise RuntimeError("the watcher's own")

    with pytest.raises(RuntimeError, match="the watcher's own"):
        fly(vehicle, on_sample=fail)
    assert vehicle.read_gains() == SAFE


def test_an_unknown_option_is_refused_by_its_name(kind: str) -> None:
    with pytest.raises(InputError) as refusal, open_vehicle(kind, {"colour": "red"}, safe_gains=SAFE):
        pass
    assert [problem.field for problem in refusal.value.problems] == ["vehicle.options.colour"]


def test_every_numeric_option_keeps_to_its_range(kind: str) -> None:
    for option in VEHICLE_KINDS[kind].options:
        assert option.upper is not None
        with (
            pytest.raises(InputError) as refusal,
            open_vehicle(kind, {option.name: option.upper * 1.01}, safe_gains=SAFE),
        ):
            pass
        assert [problem.field for problem in refusal.value.problems] == [f"vehicle.options.{option.name}"]
