"""What every vehicle that can fly must do. A new kind is covered as soon as it is registered and has a profile."""

from collections.abc import Iterator

import numpy as np
import pytest

from app.core.errors import GainsError, InputError
from app.core.records.trajectory import CHANNEL_UNITS, Trajectory
from app.vehicles.base import FlightOptions, Sample, Vehicle, VehicleError
from app.vehicles.flight_end import StopRequest
from app.vehicles.registry import VEHICLE_KINDS, open_vehicle
from tests.clocks import SimulatedClock
from tests.vehicles.flying import CAN_FLY, PROFILES, Watcher, flown, fly, never, unwatched

pytestmark = pytest.mark.parametrize("kind", CAN_FLY)


@pytest.fixture
def vehicle(kind: str) -> Iterator[Vehicle]:
    with open_vehicle(kind, {}, safe_gains=PROFILES[kind].safe) as opened:
        yield opened


def same(one: Trajectory, other: Trajectory) -> bool:
    return np.array_equal(one.time_s, other.time_s) and all(
        np.array_equal(values, other[name]) for name, values in one.channels.items()
    )


def test_a_vehicle_reports_its_identity(kind: str, vehicle: Vehicle) -> None:
    assert vehicle.kind == kind
    assert vehicle.is_real == VEHICLE_KINDS[kind].is_real
    assert vehicle.safe_gains == PROFILES[kind].safe


def test_an_opened_vehicle_holds_its_safe_gains(kind: str, vehicle: Vehicle) -> None:
    assert vehicle.read_gains() == PROFILES[kind].safe


def test_staged_gains_are_read_back_and_held(kind: str, vehicle: Vehicle) -> None:
    assert vehicle.stage(PROFILES[kind].tuned) == PROFILES[kind].tuned
    assert vehicle.read_gains() == PROFILES[kind].tuned


def test_nothing_flies_before_its_gains_are_staged(kind: str, vehicle: Vehicle) -> None:
    with pytest.raises(VehicleError, match="No gains were staged"):
        vehicle.fly(FlightOptions(seed=1), on_sample=unwatched, should_stop=never)


def test_gains_are_staged_anew_for_every_flight(kind: str, vehicle: Vehicle) -> None:
    fly(vehicle)
    assert vehicle.read_gains() == PROFILES[kind].safe
    with pytest.raises(VehicleError, match="No gains were staged"):
        vehicle.fly(FlightOptions(seed=1), on_sample=unwatched, should_stop=never)


def test_a_flight_leaves_known_channels_at_one_rate_past_the_scored_window(kind: str, vehicle: Vehicle) -> None:
    record = fly(vehicle)
    flight = record.trajectory
    assert (record.ending, record.reason, record.has_flown) == ("completed", "", True)
    assert record.settings.keys() == {option.name for option in VEHICLE_KINDS[kind].options}
    assert (flight.source, flight.clock) == (kind, "simulation")
    assert PROFILES[kind].experiment.output in flight.channels
    assert set(flight.channels) <= set(CHANNEL_UNITS)
    assert all(
        values.shape == flight.time_s.shape and values.dtype == np.float64 for values in flight.channels.values()
    )
    assert flight.time_s[0] == 0.0
    np.testing.assert_allclose(np.diff(flight.time_s), flight.time_s[1], rtol=1e-9)
    assert flight.time_s[-1] >= PROFILES[kind].scored_until_s


def test_a_vehicle_flies_the_experiments_that_it_declares(kind: str) -> None:
    assert PROFILES[kind].experiment.name in VEHICLE_KINDS[kind].experiments


def test_gains_that_are_no_gains_of_the_vehicle_are_refused_and_change_nothing(kind: str, vehicle: Vehicle) -> None:
    first = next(iter(PROFILES[kind].tuned))
    for gains, field in (
        ({name: value for name, value in PROFILES[kind].tuned.items() if name != first}, f"gains.{first}"),
        (PROFILES[kind].tuned | {first: float("nan")}, f"gains.{first}"),
        (PROFILES[kind].tuned | {first: 10**400}, f"gains.{first}"),
        (PROFILES[kind].tuned | {"kx": 1.0}, "gains.kx"),
    ):
        with pytest.raises(GainsError) as refusal:
            vehicle.stage(gains)
        assert [problem.field for problem in refusal.value.problems] == [field]
        assert vehicle.read_gains() == PROFILES[kind].safe


def test_an_abort_ends_the_manoeuvre_on_the_safe_gains_and_keeps_the_record(kind: str, vehicle: Vehicle) -> None:
    watcher = Watcher(abort_at_s=2.0)
    record = fly(vehicle, on_sample=watcher.see, should_stop=watcher.decide)
    whole = fly(vehicle).trajectory
    flight, output = record.trajectory, PROFILES[kind].experiment.output
    asked = int(np.searchsorted(flight.time_s, watcher.samples[-1].time_s))
    assert (record.ending, record.reason, record.has_flown) == ("aborted", "the operator pressed Abort", True)
    assert watcher.samples[-1].time_s == pytest.approx(2.0, abs=0.02)
    np.testing.assert_array_equal(flight[output][: asked + 1], whole[output][: asked + 1])
    assert (np.diff(flight.time_s) > 0.0).all()
    assert vehicle.read_gains() == PROFILES[kind].safe


def test_a_flight_can_be_scored_before_and_after_storage(kind: str, vehicle: Vehicle) -> None:
    flight = fly(vehicle).trajectory
    experiment = PROFILES[kind].experiment
    assert experiment.error(flight) == pytest.approx(experiment.error(flight.as_stored()), abs=1e-6)
    low, high = PROFILES[kind].tuned_error
    assert low < experiment.error(flight) < high


def test_a_seed_gives_the_same_flight_whatever_was_flown_before_and_another_one_another(kind: str) -> None:
    options = PROFILES[kind].scattered
    with open_vehicle(kind, options, safe_gains=PROFILES[kind].safe) as vehicle:
        fly(vehicle, PROFILES[kind].safe, seed=3)
        later = fly(vehicle, seed=7).trajectory
    alone = flown(kind, options, seed=7)
    assert same(later, alone)
    assert not same(alone, flown(kind, options, seed=8))


def test_telemetry_comes_at_50_hz_and_agrees_with_the_record(kind: str, vehicle: Vehicle) -> None:
    watcher = Watcher()
    flight = fly(vehicle, on_sample=watcher.see).trajectory
    times = np.array([sample.time_s for sample in watcher.samples])
    assert len(times) == pytest.approx(flight.time_s[-1] * 50, abs=2)
    np.testing.assert_allclose(np.diff(times), 0.02, atol=1 / 512)
    for sample in (watcher.samples[1], watcher.samples[200], watcher.samples[-1]):
        row = int(np.searchsorted(flight.time_s, sample.time_s))
        assert PROFILES[kind].experiment.output in sample.channels
        assert sample.channels == pytest.approx({name: flight[name][row] for name in sample.channels}, rel=1e-12)


def test_a_watched_flight_never_runs_ahead_of_its_pace(kind: str, vehicle: Vehicle) -> None:
    """Computing ahead and playing back would be early."""
    speed, clock = 2.0, SimulatedClock()
    seen: list[tuple[float, float]] = []

    def watch(sample: Sample) -> None:
        seen.append((clock.now_s(), sample.time_s))

    flight = fly(vehicle, speed=speed, on_sample=watch, clock=clock).trajectory
    assert clock.now_s() == pytest.approx(flight.time_s[-1] / speed, abs=0.02)
    assert all(clock_s >= time_s / speed - 1e-9 for clock_s, time_s in seen)


@pytest.mark.complete
def test_the_pace_does_not_change_the_flight(kind: str, vehicle: Vehicle) -> None:
    assert same(fly(vehicle, speed=100.0).trajectory, fly(vehicle).trajectory)


def test_a_flight_aborted_before_it_starts_leaves_one_instant(kind: str, vehicle: Vehicle) -> None:
    record = fly(vehicle, should_stop=lambda: StopRequest("changed my mind"))
    assert (record.ending, record.reason, record.has_flown) == ("aborted", "changed my mind", False)
    assert record.trajectory.time_s.tolist() == [0.0]


def test_the_safe_gains_are_restored_on_exit(kind: str) -> None:
    with open_vehicle(kind, {}, safe_gains=PROFILES[kind].safe) as vehicle:
        vehicle.stage(PROFILES[kind].tuned)
    assert vehicle.read_gains() == PROFILES[kind].safe


def test_the_safe_gains_are_restored_when_the_caller_fails(kind: str) -> None:
    held: list[Vehicle] = []

    def leave_badly() -> None:
        with open_vehicle(kind, {}, safe_gains=PROFILES[kind].safe) as vehicle:
            held.append(vehicle)
            vehicle.stage(PROFILES[kind].tuned)
            raise RuntimeError("the caller's own")

    with pytest.raises(RuntimeError, match="the caller's own"):
        leave_badly()
    assert held[0].read_gains() == PROFILES[kind].safe


def test_the_safe_gains_are_restored_when_a_watcher_fails_in_flight(kind: str, vehicle: Vehicle) -> None:
    def fail(sample: Sample) -> None:
        if sample.time_s > 1.0:
            raise RuntimeError("the watcher's own")

    with pytest.raises(RuntimeError, match="the watcher's own"):
        fly(vehicle, on_sample=fail)
    assert vehicle.read_gains() == PROFILES[kind].safe


def test_an_unknown_option_is_refused_by_its_name(kind: str) -> None:
    with pytest.raises(InputError) as refusal, open_vehicle(kind, {"colour": "red"}, safe_gains=PROFILES[kind].safe):
        pass
    assert [problem.field for problem in refusal.value.problems] == ["vehicle.options.colour"]


def test_every_numeric_option_keeps_to_its_range(kind: str) -> None:
    for option in VEHICLE_KINDS[kind].options:
        assert option.upper is not None
        with (
            pytest.raises(InputError) as refusal,
            open_vehicle(kind, {option.name: option.upper * 1.01}, safe_gains=PROFILES[kind].safe),
        ):
            pass
        assert [problem.field for problem in refusal.value.problems] == [f"vehicle.options.{option.name}"]
