import numpy as np
import pytest

from app.core.definition import Flight
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.records.trajectory import Trajectory
from app.core.tuning.corrected_model import correct_by_bias, uncorrected_model
from tests.core.tuning.bowl import QuadraticExperiment, fly
from tests.core.tuning.flying import TAKEOFF
from tests.core.tuning.flying import fly as take_off


def test_the_corrected_model_reproduces_the_flight_that_corrected_it() -> None:
    flight = take_off(1, {"kp": 283, "ki": 13, "kd": 82})
    found = correct_by_bias(TAKEOFF, flight).predict(TAKEOFF.space.default)
    assert found.trajectory["altitude_m"] == pytest.approx(flight.trajectory["altitude_m"], abs=1e-12)
    assert found.error == pytest.approx(flight.error, abs=1e-12)


def test_a_fresh_flight_corrects_bit_for_bit_like_a_stored_one() -> None:
    stored = fly(1, 50.0, 70)
    noise = np.random.default_rng(7).normal(size=11)
    fresh = Trajectory(
        QuadraticExperiment().grid_s, {"depth": stored.trajectory["depth"] + noise}, "model", "simulation"
    )
    biases = [
        correct_by_bias(
            QuadraticExperiment(),
            type(stored)(number=1, gains=stored.gains, trajectory=trajectory, error=1, outcome="valid"),
        )
        for trajectory in (fresh, fresh.as_stored())
    ]
    assert np.array_equal(biases[0].bias, biases[1].bias)


def test_flights_sampled_otherwise_are_brought_to_the_grid_and_held_beyond_their_ends() -> None:
    flight = fly(1, 30.0, 40, offset=0.0)
    ramp = Trajectory(np.array([0.25, 0.75]), {"depth": np.array([1.25, 1.75])}, "csv", "vehicle")
    recorded = type(flight)(number=1, gains=flight.gains, trajectory=ramp, error=1.0, outcome="valid")
    assert correct_by_bias(QuadraticExperiment(), recorded).bias == pytest.approx(
        np.clip(QuadraticExperiment().grid_s, 0.25, 0.75), abs=1e-7
    )


def test_before_any_flight_nothing_is_corrected() -> None:
    assert not uncorrected_model(TAKEOFF).bias.any()


def test_a_step_that_takes_effect_late_corrects_nothing_where_the_reference_was_recorded() -> None:
    """Over a link it does. A third of the speed of a step, 0.7 m/s, times 40 ms would be taken for the gains'."""
    steps = AltitudeSteps().configured({"steps": 2, "step_window_s": 3.0})
    gains = steps.space.mapping(steps.space.default)
    altitude, grid_s = uncorrected_model(steps).outputs(steps.space.default[np.newaxis])[0], steps.grid_s
    late_s = grid_s - 0.04 * (grid_s > 9.0)
    channels = {
        "altitude_m": np.interp(late_s, grid_s, altitude),
        "reference_m": np.interp(late_s, grid_s, steps.reference),
    }
    largest = []
    for names in (("altitude_m",), ("altitude_m", "reference_m")):
        record = Trajectory(grid_s, {name: channels[name] for name in names}, "mavlink", "vehicle")
        flight = Flight(number=1, gains=gains, trajectory=record, error=0.1, outcome="valid")
        largest.append(float(np.abs(correct_by_bias(steps, flight).bias).max()))
    assert largest[0] > 0.02
    assert largest[1] < 0.01
