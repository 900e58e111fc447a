from dataclasses import replace

import numpy as np
import pytest

from app.core.definition import Flight
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.models.f16 import ELEMENTS, SYSTEM, perturbed
from app.core.records.trajectory import Trajectory
from app.core.tuning.strategies.identified import Fit, identify
from app.vehicles.f16 import LOG_NOISE
from tests.vehicles.flying import HAND, TRACKING, flown

MODEL = PitchTracking({"model_seed": 50})
TRUE_LOGARITHMS = np.log(SYSTEM[ELEMENTS] / perturbed(0.45, 50)[ELEMENTS])
RUNAWAY = HAND | {"theta_3": 0.0, "theta_4": -57.3, "theta_5": -57.3, "theta_6": 0.5}


def flight(number: int, gains: dict[str, float], log_noise: float = 0.0) -> Flight:
    record = flown("lti", {"log_noise": log_noise}, gains, seed=number).as_stored()
    return Flight(number=number, gains=gains, trajectory=record, error=MODEL.error(record), outcome="valid")


@pytest.mark.parametrize("fit", ["least-squares", "map"])
def test_one_clean_flight_gives_back_what_it_can_show(fit: Fit) -> None:
    """Within 0.5 %, though every element of the model is off by up to 45 %. What thrust and speed do to speed cannot
    be told apart, because thrust follows speed; that keeps the standard error of what was known before."""
    found = identify(MODEL, [flight(1, HAND)], fit)
    assert found is not None
    shown = np.diag(found.covariance) < 0.005**2
    assert shown.sum() >= 14
    assert found.model[shown] == pytest.approx(TRUE_LOGARITHMS[shown], abs=0.005)
    off = np.abs(found.model - TRUE_LOGARITHMS) / np.sqrt(np.diag(found.covariance))
    assert off[~shown].max() < 4.0
    assert found.flights == (1,)
    assert found.pitch_noise_rad < 1e-6


def test_windows_of_a_second_bear_noise_that_single_steps_do_not() -> None:
    """What the flight shows best, the elevator's effect on the pitch rate (standard error below 1 %)."""
    noisy = flight(1, TRACKING, log_noise=1.0)
    windows, steps = identify(MODEL, [noisy], "map"), identify(MODEL, [noisy], "least-squares")
    assert windows is not None
    assert steps is not None
    assert windows.noise == pytest.approx(LOG_NOISE, rel=0.1)
    off, expected = windows.model - TRUE_LOGARITHMS, np.sqrt(np.diag(windows.covariance))
    assert np.abs(off / expected).max() < 4.0
    assert expected[-1] < 0.02
    assert abs(steps.model[-1] - TRUE_LOGARITHMS[-1]) > 3.0 * abs(off[-1])


def test_more_flights_leave_less_open() -> None:
    one = identify(MODEL, [flight(1, TRACKING, 1.0)], "map")
    two = identify(MODEL, [flight(1, TRACKING, 1.0), flight(2, HAND, 1.0)], "map")
    assert one is not None
    assert two is not None
    assert two.flights == (1, 2)
    assert (np.diag(two.covariance) < np.diag(one.covariance)).all()


def test_a_flight_counts_up_to_its_divergence_and_an_aborted_one_to_its_end() -> None:
    runaway = flight(1, RUNAWAY)
    whole = flight(2, HAND)
    until = Trajectory(
        whole.trajectory.time_s[:500],
        {name: values[:500] for name, values in whole.trajectory.channels.items()},
        "lti",
        "simulation",
    )
    aborted = replace(whole, trajectory=until, error=None, outcome="aborted")
    for flights in ([runaway], [aborted]):
        found = identify(MODEL, flights, "map")
        assert found is not None
        assert found.model[-1] == pytest.approx(TRUE_LOGARITHMS[-1], abs=0.01)


def test_without_states_and_commands_nothing_can_be_identified() -> None:
    whole = flight(1, HAND)
    bare = Trajectory(whole.trajectory.time_s, {"pitch_error_rad": whole.trajectory["pitch_error_rad"]}, "csv", "x")
    nothing = Trajectory(np.empty(0), {}, "none", "none")
    short = Trajectory(
        whole.trajectory.time_s[:40],
        {name: values[:40] for name, values in whole.trajectory.channels.items()},
        "lti",
        "simulation",
    )
    for trajectory in (bare, nothing, short):
        assert identify(MODEL, [replace(whole, trajectory=trajectory)], "map") is None
