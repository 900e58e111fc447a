"""The fit against flights whose parameters are known."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.definition import Definition, Flight
from app.core.experiments.base import prior_distribution
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.records.trajectory import Trajectory
from app.core.tuning.calibration import MAX_FLIGHTS, calibrate
from app.core.tuning.campaign_models import known_distribution
from tests.core.tuning.defined import evidence
from tests.core.tuning.flying import TAKEOFF, compiled_only, fly

pytestmark = compiled_only

DEFAULT = {"kp": 283, "ki": 13, "kd": 82}
TUNED = {"kp": 1600, "ki": 1023, "kd": 127}
NAMES = [parameter.name for parameter in TAKEOFF.model_parameters]
TRUTHS = [
    (0.61, 0.3, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.52, 0.1, 0.08, 0.3, 0.0, 0.0, 0.0, 0.0),
    (0.70, 0.35, 0.03, 0.1, 0.5, 0.1, 0.0, 0.01),
    (0.48, 0.05, 0.06, 0.05, 0.8, 0.05, 0.02, 0.02),
]
TOLERANCES = {"hover_throttle": 0.005, "start_latency_s": 0.06, "motor_lag_s": 0.03, "quadratic_share": 0.12}


def gusty(flight: Flight, seed: int, sd: float = 0.02) -> Flight:
    """The same flight with a swing of one second's memory added to its altitude."""
    generator = np.random.default_rng(seed)
    swing = np.convolve(generator.normal(size=len(flight.trajectory) + 512), np.hanning(512), mode="valid")
    altitude = flight.trajectory["altitude_m"] + sd * swing[: len(flight.trajectory)] / swing.std()
    trajectory = Trajectory(flight.trajectory.time_s, {"altitude_m": altitude}, "csv", "vehicle").as_stored()
    return replace(flight, trajectory=trajectory, error=TAKEOFF.error(trajectory))


@pytest.mark.parametrize("truth", TRUTHS)
def test_two_flights_give_the_parameters_back(truth: tuple[float, ...]) -> None:
    found = calibrate(TAKEOFF, [fly(1, DEFAULT, truth), fly(2, TUNED, truth)])
    for name, value, true in zip(NAMES, found.model, truth, strict=True):
        if name in TOLERANCES:
            assert value == pytest.approx(true, abs=TOLERANCES[name]), name
    outputs = TAKEOFF.outputs(np.array([list(DEFAULT.values()), list(TUNED.values())], dtype=float), found.model)
    flown = [TAKEOFF.error(fly(1, gains, truth).trajectory) for gains in (DEFAULT, TUNED)]
    assert TAKEOFF.errors(outputs) == pytest.approx(flown, abs=0.008)


def test_the_truth_lies_within_three_standard_errors_on_a_swinging_flight() -> None:
    """32 numbers of four vehicles, one flight each; a latency also within the 60 ms by which starts differ."""
    for seed, truth in enumerate(TRUTHS):
        found = calibrate(TAKEOFF, [gusty(fly(1, DEFAULT, truth), seed)])
        misses = (found.model - np.array(truth)) / np.sqrt(np.diag(found.covariance))
        assert np.abs(misses).max() < 3.0
        assert 0.01 < found.noise < 0.04


def test_a_second_flight_narrows_what_is_open() -> None:
    one, two = gusty(fly(1, DEFAULT), 1), gusty(fly(2, TUNED), 2)
    first, both = calibrate(TAKEOFF, [one]), calibrate(TAKEOFF, [one, two])
    assert (np.diag(both.covariance) < np.diag(first.covariance) * 1.1).all()
    place = NAMES.index("motor_lag_s")
    assert both.covariance[place, place] < 0.5 * first.covariance[place, place]
    assert both.numbers == (1, 2)


def test_flights_that_started_at_other_instants_are_each_given_their_own_start() -> None:
    """40 ms apart; the parameter lies between them."""
    early, late = ((0.61, 0.28, 0.05, 0, 0, 0, 0, 0), (0.61, 0.32, 0.05, 0, 0, 0, 0, 0))
    found = calibrate(TAKEOFF, [fly(1, TUNED, early), fly(2, TUNED, late)])
    latency = NAMES.index("start_latency_s")
    assert found.own_models[1, latency] - found.own_models[0, latency] == pytest.approx(0.04, abs=0.005)
    assert np.abs(found.residual).max() < 0.1


def test_fresh_flights_and_stored_ones_give_the_same_fit_bit_for_bit() -> None:
    stored = gusty(fly(1, DEFAULT), 3)
    generator = np.random.default_rng(4)
    noise = 1e-9 * generator.normal(size=len(stored.trajectory))
    fresh = replace(
        stored, trajectory=replace(stored.trajectory, channels={"altitude_m": stored.trajectory["altitude_m"] + noise})
    )
    one, other = calibrate(TAKEOFF, [stored]), calibrate(TAKEOFF, [fresh])
    assert one.model.tobytes() == other.model.tobytes()
    assert one.covariance.tobytes() == other.covariance.tobytes()


def test_plausible_models_have_the_fits_mean_and_covariance() -> None:
    """Where no limit cuts them off: hover throttle and drag of this vehicle."""
    found = calibrate(TAKEOFF, [gusty(fly(1, DEFAULT, TRUTHS[1]), 5)])
    models = found.plausible(runs=16)
    assert models.shape == (16, len(NAMES))
    for name in ("hover_throttle", "drag_1_s"):
        place = NAMES.index(name)
        assert models[:, place].mean() == pytest.approx(found.model[place], abs=1e-9)
        assert models[:, place].var() == pytest.approx(found.covariance[place, place], rel=1e-6)
    latency = NAMES.index("start_latency_s")
    assert found.plausible(runs=16, next_flight=True)[:, latency].std() > models[:, latency].std()


def test_fitted_parameters_come_with_their_standard_errors_and_what_was_known() -> None:
    fitted = {one.name: one for one in calibrate(TAKEOFF, [gusty(fly(1, DEFAULT), 6)]).fitted}
    assert list(fitted) == NAMES
    hover = fitted["hover_throttle"]
    assert (hover.nominal, hover.prior_sd) == (0.63, 0.09)
    assert hover.value == pytest.approx(0.61, abs=0.01)
    assert 0.001 < hover.standard_error < 0.01
    assert fitted["motor_lag_s"].nominal == 0.05


def test_before_a_flight_the_data_sheet_is_what_is_known_afterwards_the_fit() -> None:
    aborted = replace(fly(1, DEFAULT), outcome="aborted", error=None)
    assert (
        known_distribution(evidence(Definition(), TAKEOFF, []))
        == known_distribution(evidence(Definition(), TAKEOFF, [aborted]))
        == prior_distribution(TAKEOFF)
    )
    assert known_distribution(evidence(Definition(), PitchTracking(), [])) == prior_distribution(PitchTracking())
    flight = gusty(fly(2, DEFAULT), 7)
    spread = known_distribution(evidence(Definition(), TAKEOFF, [aborted, flight]))
    assert spread.origin == "the calibration on 1 flight"
    assert spread.mean[0] == pytest.approx(0.61, abs=0.01)
    floor = 0.05 * TAKEOFF.model_parameters[0].prior_sd
    assert floor < np.sqrt(spread.covariance[0][0]) < 0.02


def test_of_a_long_campaign_the_best_and_the_latest_flights_are_fitted() -> None:
    flights = [fly(1, DEFAULT), fly(2, TUNED), *(fly(number, DEFAULT) for number in range(3, MAX_FLIGHTS + 4))]
    assert calibrate(TAKEOFF, flights).numbers == (2, *range(5, MAX_FLIGHTS + 4))
