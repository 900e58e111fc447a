import numpy as np
import pytest
from numpy.typing import NDArray

from app.core.errors import InputError
from app.vehicles.registry import open_vehicle
from bench.targets.vehicles import fly as fly_quickly
from bench.targets.vehicles import population
from tests.vehicles.flying import SAFE, TAKEOFF, TUNED, Watcher, flown, fly

REPEATS = 120


def spread(gains: dict[str, float]) -> float:
    """Standard deviation of the error over repeated takeoffs, m: quick flights, which are those of `open_vehicle`."""
    (twin,) = population("twin", 1, 1)
    return float(np.std([TAKEOFF.error(fly_quickly(twin, gains, seed=seed)) for seed in range(REPEATS)]))


MODEL = {"hover_throttle": 0.58, "motor_lag_s": 0.04, "start_latency_s": 128 / 512, "drag_1_s": 0.1}


@pytest.mark.parametrize("gains", [SAFE, TUNED])
@pytest.mark.parametrize("further", [{}, {"quadratic_share": 0.6, "ground_effect": 0.2, "measurement_delay_s": 0.031}])
def test_without_scatter_it_is_the_simple_model(gains: dict[str, float], further: dict[str, float]) -> None:
    """A latency of whole steps, because the vehicle starts on one and the model may start between two."""
    model = MODEL | further
    twin = flown("twin", {"scatter": 0.0, **model}, gains)
    names = [parameter.name for parameter in TAKEOFF.model_parameters]
    expected = TAKEOFF.simulate(TAKEOFF.space.vector(gains), np.array([model.get(name, 0.0) for name in names]))
    for channel in ("altitude_m", "climb_rate_m_s", "thrust"):
        np.testing.assert_allclose(twin[channel][: len(expected)], expected[channel], atol=1e-9)


def test_without_scatter_every_seed_flies_alike() -> None:
    one, other = (flown("twin", {"scatter": 0.0}, seed=seed) for seed in (1, 2))
    np.testing.assert_array_equal(one["altitude_m"], other["altitude_m"])


@pytest.mark.complete
@pytest.mark.parametrize(("gains", "paper_m"), [(SAFE, 0.0141), ({"kp": 1624, "ki": 1356, "kd": 195}, 0.0066)])
def test_repeated_takeoffs_scatter_as_the_real_drones_did(gains: dict[str, float], paper_m: float) -> None:
    """Fig. 12 of the paper; the spread of 120 flights is itself known to 6 %."""
    assert spread(gains) == pytest.approx(paper_m, rel=0.3)


@pytest.mark.complete
def test_scatter_grows_with_its_option() -> None:
    def deviation(scatter: float) -> float:
        return abs(TAKEOFF.error(flown("twin", {"scatter": scatter}, SAFE, seed=4))
                   - TAKEOFF.error(flown("twin", {"scatter": 0.0}, SAFE)))  # fmt: skip

    assert 0.0 < deviation(0.1) < deviation(1.0) < deviation(4.0)


FURTHER = {
    "scatter": 0.0,
    "hover_throttle": 0.58,
    "motor_lag_s": 0.04,
    "start_latency_s": 0.25,
    "drag_1_s": 0.2,
    "quadratic_share": 0.6,
    "ground_effect": 0.2,
    "ground_effect_height_m": 0.3,
    "measurement_delay_s": 0.031,
    "battery_sag": 0.03,
}


def altitude_from_thrust(thrust: NDArray[np.float64]) -> NDArray[np.float64]:
    """The physics of docs/vehicles.md with the options above, integrated from a recorded command, in plain Python."""
    height, climb, u, altitude = 0.0, 0.0, 0.0, []
    for i, command in enumerate(thrust):
        altitude.append(height)
        u += (command - u) / (512 * 0.04)
        lift = (0.4 * u + 0.6 * u**2) / (0.4 * 0.58 + 0.6 * 0.58**2)
        lift *= (1.0 + 0.2 * np.exp(-height / 0.3)) * (1.0 - 0.03 * (i / 512) / 33.0)
        height, climb = height + climb / 512, climb + (9.81 * (lift - 1.0) - 0.2 * climb) / 512
        if height <= 0.0:
            height, climb = 0.0, max(climb, 0.0)
    return np.array(altitude)


def test_physics_beyond_the_nominal_model_is_the_documented_one() -> None:
    """The altitude sensed is 0.031 s old: the integrated one, that much later."""
    twin = flown("twin", FURTHER, SAFE)
    late_s = np.maximum(twin.time_s - 0.031, 0.0)
    expected = np.interp(late_s, twin.time_s, altitude_from_thrust(twin["thrust"]))
    np.testing.assert_allclose(twin["altitude_m"], expected, atol=1e-9)


@pytest.mark.parametrize("quadratic_share", [0.0, 0.5, 1.0])
def test_it_hovers_at_its_hover_throttle_however_thrust_grows(quadratic_share: float) -> None:
    twin = flown("twin", {"scatter": 0.0, "hover_throttle": 0.7, "quadratic_share": quadratic_share})
    assert twin["thrust"][-512:].mean() == pytest.approx(0.7, abs=2e-3)


def test_a_sagging_battery_shows_in_its_voltage_which_goes_with_the_root_of_thrust() -> None:
    voltage = flown("twin", {"battery_sag": 0.03})["battery_v"]
    assert voltage[0] == 11.1
    assert voltage[-1] == pytest.approx(11.1 * np.sqrt(0.97), abs=1e-6)
    assert (np.diff(voltage) < 0.0).all()


def test_a_battery_that_could_not_carry_the_vehicle_to_the_end_is_refused() -> None:
    with pytest.raises(InputError) as refusal:
        flown("twin", {"hover_throttle": 0.9, "battery_sag": 0.1})
    assert [problem.field for problem in refusal.value.problems] == ["vehicle.options.battery_sag"]


def test_an_abort_with_everything_on_lands() -> None:
    with open_vehicle("twin", FURTHER, safe_gains=SAFE) as vehicle:
        watcher = Watcher(abort_at_s=20.0)
        record = fly(vehicle, on_sample=watcher.see, should_stop=watcher.decide)
    assert record.ending == "aborted"
    assert record.trajectory["altitude_m"][-1] < 0.1
