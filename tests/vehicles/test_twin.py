import numpy as np
import pytest

from app.vehicles.open import open_vehicle
from tests.vehicles.flying import SAFE, TAKEOFF, TUNED, flown, fly

REPEATS = 120


def spread(gains: dict[str, float]) -> float:
    """Standard deviation of the error over repeated takeoffs, m."""
    with open_vehicle("twin", {}, safe_gains=SAFE) as vehicle:
        return float(np.std([TAKEOFF.error(fly(vehicle, gains, seed=seed).trajectory) for seed in range(REPEATS)]))


@pytest.mark.parametrize("gains", [SAFE, TUNED])
def test_without_scatter_it_is_the_simple_model(gains: dict[str, float]) -> None:
    """A latency of whole steps, because the vehicle starts on one and the model may start between two."""
    model = {"hover_throttle": 0.58, "motor_lag_s": 0.04, "start_latency_s": 128 / 512, "drag_1_s": 0.1}
    twin = flown("twin", {"scatter": 0.0, **model}, gains)
    names = [parameter.name for parameter in TAKEOFF.model_parameters]
    expected = TAKEOFF.simulate(TAKEOFF.space.vector(gains), np.array([model[name] for name in names]))
    for channel in ("altitude_m", "climb_rate_m_s", "thrust"):
        np.testing.assert_allclose(twin[channel][: len(expected)], expected[channel], atol=1e-12)


def test_without_scatter_every_seed_flies_alike() -> None:
    one, other = (flown("twin", {"scatter": 0.0}, seed=seed) for seed in (1, 2))
    np.testing.assert_array_equal(one["altitude_m"], other["altitude_m"])


@pytest.mark.parametrize(("gains", "paper_m"), [(SAFE, 0.0141), ({"kp": 1624, "ki": 1356, "kd": 195}, 0.0066)])
def test_repeated_takeoffs_scatter_as_the_real_drones_did(gains: dict[str, float], paper_m: float) -> None:
    """Fig. 12 of the paper; the spread of 120 flights is itself known to 6 %."""
    assert spread(gains) == pytest.approx(paper_m, rel=0.3)


def test_scatter_grows_with_its_option() -> None:
    def deviation(scatter: float) -> float:
        return abs(TAKEOFF.error(flown("twin", {"scatter": scatter}, SAFE, seed=4))
                   - TAKEOFF.error(flown("twin", {"scatter": 0.0}, SAFE)))  # fmt: skip

    assert 0.0 < deviation(0.1) < deviation(1.0) < deviation(4.0)
