import numpy as np
import pytest

from app.core.experiments.pitch_tracking import PitchTracking
from app.vehicles.f16 import LOG_NOISE, whole_flight
from app.vehicles.registry import open_vehicle
from tests.vehicles.flying import HAND, TRACKING, Watcher, flown, fly

RUNAWAY = HAND | {"theta_3": 0.0, "theta_4": -57.3, "theta_5": -57.3, "theta_6": 0.5}


def test_the_aircraft_flies_as_the_experiments_truth() -> None:
    """J(hand) = 3.38180 rad·s on the truth."""
    truth = PitchTracking({"perturbation": 0.0})
    flight = flown("lti", {}, HAND)
    model = truth.simulate(truth.space.default, truth.nominal_model)
    assert truth.error(flight) == pytest.approx(3.38180, abs=1e-4)
    assert set(flight.channels) == set(model.channels)
    for name, values in flight.channels.items():
        assert values == pytest.approx(model[name], abs=1e-9)


@pytest.mark.parametrize(("gains", "log_noise"), [(TRACKING, 0.0), (HAND, 1.5), (RUNAWAY, 1.0)])
def test_a_flight_in_one_call_is_the_flight_of_the_vehicle_seam(gains: dict[str, float], log_noise: float) -> None:
    quick, seam = (
        whole_flight(gains, log_noise=log_noise, seed=5),
        flown("lti", {"log_noise": log_noise}, gains, seed=5),
    )
    np.testing.assert_array_equal(quick.time_s, seam.time_s)
    assert list(quick.channels) == list(seam.channels)
    for name, values in seam.channels.items():
        np.testing.assert_array_equal(quick[name], values, err_msg=name)


def test_the_records_noise_is_as_large_as_it_says_and_leaves_the_flight_alone() -> None:
    clean, noisy = flown("lti", {}, TRACKING), flown("lti", {"log_noise": 2.0}, TRACKING)
    names = ("altitude_change_m", "pitch_rad", "speed_change_m_s", "angle_of_attack_rad", "pitch_rate_rad_s")
    si = LOG_NOISE * np.array([0.3048, 1.0, 0.3048, 1.0, 1.0])
    measured = [np.std(noisy[name] - clean[name]) for name in names]
    assert measured == pytest.approx(2.0 * si, rel=0.06)  # 3001 samples: the sd of a sd is 1.3 %
    assert (noisy["elevator_rad"] == clean["elevator_rad"]).all()
    assert (noisy["thrust_change_n"] == clean["thrust_change_n"]).all()


def test_a_flight_that_runs_away_stands_still_at_10_rad_and_can_be_scored() -> None:
    flight = flown("lti", {}, RUNAWAY)
    error = np.abs(flight["pitch_error_rad"])
    first = int(np.argmax(error >= 10.0))
    assert 0 < first < 3000
    assert np.ptp(error[first:]) == 0.0
    assert PitchTracking().error(flight) > 100.0


def test_after_an_abort_the_pitch_returns_to_trim_for_ten_seconds() -> None:
    with open_vehicle("lti", {}, safe_gains=HAND) as vehicle:
        watcher = Watcher(abort_at_s=5.0)
        flight = fly(vehicle, on_sample=watcher.see, should_stop=watcher.decide).trajectory
    after = flight.time_s > watcher.samples[-1].time_s
    assert flight.time_s[-1] == pytest.approx(15.0, abs=0.03)
    assert not flight["pitch_reference_rad"][after].any()
    assert abs(flight["pitch_rad"][-1]) < 0.5 * abs(flight["pitch_rad"][after][0])
