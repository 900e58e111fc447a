import numpy as np
import pytest

from app.core.errors import InputError
from app.core.models.vertical import GRAVITY_M_S2
from app.core.records.trajectory import Trajectory
from app.vehicles.jsbsim import FULL_THRUST_N
from bench.targets import vehicles
from bench.targets.vehicles import (
    _REFINEMENT,
    SampledVehicle,
    _model_of,
    _model_optimum,
    fly,
    is_unsafe,
    noise_free_error,
    own_optimum,
    population,
)
from tests.vehicles.flying import SAFE, TAKEOFF, TUNED, flown

FURTHER = population("further-physics", 20, 3)
FOUR = population("four-parameter", 20, 3)


def hover(vehicle: SampledVehicle) -> float:
    numbers = {name: float(value) for name, value in vehicle.options.items()}
    if vehicle.kind == "twin":
        return numbers["hover_throttle"]
    return numbers["mass_kg"] * GRAVITY_M_S2 / (FULL_THRUST_N * numbers["thrust_scale"])


def test_the_first_vehicles_of_a_population_do_not_depend_on_how_many_are_asked_for() -> None:
    assert population("further-physics", 7, 3) == FURTHER[:7]
    assert population("further-physics", 7, 4) != FURTHER[:7]


def test_vehicles_lie_in_the_ranges_of_their_population() -> None:
    for vehicle in (*FOUR, *FURTHER):
        assert 0.45 <= hover(vehicle) <= 0.75
        assert 0.0 <= float(vehicle.options["motor_lag_s"]) <= 0.1
        assert 0.0 <= float(vehicle.options["start_latency_s"]) <= 0.4
        assert 0.0 <= float(vehicle.options["battery_sag"]) <= (0.0 if vehicle in FOUR else 0.03)
    assert {vehicle.kind for vehicle in FOUR} == {"twin"}
    assert [vehicle.number for vehicle in FURTHER if vehicle.kind == "jsbsim"] == [10, 20]


def test_an_unknown_population_is_refused_by_name() -> None:
    with pytest.raises(InputError) as refusal:
        population("birds", 1, 1)
    assert refusal.value.problems[0].field == "population"


@pytest.mark.complete
@pytest.mark.parametrize("vehicle", [FURTHER[0], FURTHER[9]], ids=lambda vehicle: vehicle.kind)
def test_a_quick_flight_is_the_flight_of_the_vehicle_seam(vehicle: SampledVehicle) -> None:
    quick, seam = fly(vehicle, TUNED, seed=5), flown(vehicle.kind, vehicle.options, TUNED, seed=5)
    np.testing.assert_array_equal(quick.time_s, seam.time_s)
    assert list(quick.channels) == list(seam.channels)
    for name, values in seam.channels.items():
        np.testing.assert_array_equal(quick[name], values, err_msg=name)


@pytest.mark.complete
@pytest.mark.parametrize("vehicle", [FURTHER[0], FURTHER[9]], ids=lambda vehicle: vehicle.kind)
def test_the_noise_free_error_is_the_error_of_a_flight_without_scatter(vehicle: SampledVehicle) -> None:
    error = TAKEOFF.error(fly(vehicle.quiet, TUNED, seed=9))
    assert noise_free_error(vehicle, TUNED) == pytest.approx(error, abs=1e-9)
    assert TAKEOFF.error(fly(vehicle, TUNED, seed=9)) != pytest.approx(error, abs=1e-6)


def altitudes(*pieces: tuple[float, float]) -> Trajectory:
    """An altitude (m) from each time (s) on, for 33 s."""
    time_s = np.arange(0.0, 33.0, 0.01)
    altitude = np.zeros_like(time_s)
    for start_s, value_m in pieces:
        altitude[time_s >= start_s] = value_m
    return Trajectory(time_s, {"altitude_m": altitude}, "twin", "simulation")


@pytest.mark.parametrize(
    ("pieces", "unsafe"),
    [
        ([(2.0, 3.0)], False),
        ([(2.0, 3.74), (4.0, 2.26)], False),
        ([(2.0, 3.76), (3.0, 3.0)], True),
        ([(2.0, 3.0), (4.0, 1.0), (4.9, 3.0)], False),
        ([(2.0, 3.0), (20.0, 2.24), (20.1, 3.0)], True),
        ([(5.5, 3.0)], True),
        ([(2.0, 3.0), (30.0, float("nan"))], True),
    ],
)
def test_what_is_unsafe(pieces: list[tuple[float, float]], unsafe: bool) -> None:
    assert is_unsafe(altitudes(*pieces)) is unsafe


@pytest.mark.complete
def test_the_twins_own_optimum_is_at_least_as_good_as_the_reference_measurement() -> None:
    """0.1181 m near 1567, 1037, 173, which lies inside the default bounds."""
    twin = population("twin", 1, 1)[0]
    optimum = own_optimum(twin)
    assert optimum.error == noise_free_error(twin, optimum.gains)
    assert optimum.error <= 0.11815
    TAKEOFF.space.check(optimum.gains)


@pytest.mark.complete
def test_a_search_in_jsbsim_ends_below_its_models_optimum_and_the_known_good_gains(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A short search: eight flights of Nelder–Mead, and no finer steps than the coarsest."""
    step, _evaluations, coarsest, _finest = _REFINEMENT["jsbsim"]
    vehicle = FURTHER[9]
    by_model = noise_free_error(
        vehicle, TAKEOFF.space.mapping(TAKEOFF.space.nearest(_model_optimum(_model_of(vehicle))))
    )
    monkeypatch.setattr(vehicles, "_REFINEMENT", {"jsbsim": (step, 8, coarsest, coarsest)})
    optimum = own_optimum(vehicle)
    assert optimum.error == noise_free_error(vehicle, optimum.gains)
    assert optimum.error < by_model < noise_free_error(vehicle, TUNED) < noise_free_error(vehicle, SAFE)
