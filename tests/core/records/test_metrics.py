import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.errors import TrajectoryError
from app.core.records.metrics import mean_absolute_error, overshoot, require_scorable
from app.core.records.trajectory import Samples, Trajectory


def three(time_s: Samples) -> Samples:
    return np.where(time_s >= 0.0, 3.0, 0.0)


def flight(time_s: Samples, altitude_m: Samples) -> Trajectory:
    return Trajectory(time_s, {"altitude_m": altitude_m}, "csv", "vehicle")


@given(st.floats(-5, 10), st.floats(0.01, 0.2))
def test_a_constant_altitude_scores_its_distance(altitude: float, step_s: float) -> None:
    time_s = np.arange(-1.0, 12.0, step_s)
    assert mean_absolute_error(time_s, np.full_like(time_s, altitude), three, 0.0, 10.0) == pytest.approx(
        abs(3.0 - altitude), abs=1e-9
    )


def test_uneven_samples_are_weighted_by_the_time_they_stand_for() -> None:
    """A ramp from 0 to 3 m over the window has the mean error 1.5 m, however it is sampled."""
    time_s = np.array([-1.0, 0.3, 0.31, 0.32, 4.0, 7.5, 9.9, 11.0])
    assert mean_absolute_error(time_s, 0.3 * time_s, three, 0.0, 10.0) == pytest.approx(1.5, abs=1e-12)


def test_outside_the_samples_the_nearest_holds() -> None:
    assert mean_absolute_error(np.array([0.2, 9.8]), np.array([2.0, 2.0]), three, 0.0, 10.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("altitudes_m", "expected_m"),
    [((9.0, 0.0, 2.0, 3.4, 3.0), 0.4), ((9.0, 0.0, 1.0, 2.0, 2.9), 0.0), ((9.0, -0.1, 3.0, 3.0, 2.0), 0.0)],
)
def test_the_overshoot_is_the_largest_excess_after_the_command(
    altitudes_m: tuple[float, ...], expected_m: float
) -> None:
    time_s = np.array([-0.5, 0.0, 1.0, 2.0, 3.0])
    assert overshoot(time_s, np.array(altitudes_m), three) == pytest.approx(expected_m, abs=1e-12)


def test_without_a_command_or_a_rise_there_is_no_overshoot() -> None:
    before = np.array([-2.0, -1.0])
    assert overshoot(before, np.ones(2), three) is None
    assert overshoot(np.array([0.0, 1.0]), np.ones(2), np.zeros_like) is None


def good() -> tuple[Samples, Samples]:
    time_s = np.arange(0.0, 10.1, 0.1)
    return time_s, np.full_like(time_s, 2.0)


def test_a_complete_flight_is_scorable_and_gaps_outside_the_window_do_not_matter() -> None:
    time_s, altitude_m = good()
    require_scorable(flight(time_s, altitude_m), "altitude_m", 0.0, 10.0)
    padded = np.concatenate(([-9.0], time_s, [19.0]))
    require_scorable(flight(padded, np.full_like(padded, 2.0)), "altitude_m", 0.0, 10.0)


def test_gaps_of_a_quarter_second_are_allowed_even_in_single_precision() -> None:
    time_s = np.arange(0.1, 40.0, 0.25)
    require_scorable(flight(time_s, time_s).as_stored(), "altitude_m", 0.1, 32.6)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda t, z: (np.delete(t, [40, 41]), np.delete(z, [40, 41])), r"time_s: has a gap of 0\.3 s after 3\.900 s"),
        (lambda t, z: (t[3:], z[3:]), r"time_s: covers 0\.3 … 10 s; 0 … 10 s after"),
        (lambda t, z: (t[:-4], z[:-4]), r"time_s: covers .*; 0 … 10 s after"),
        (lambda t, z: (t[:0], z[:0]), r"time_s: covers nothing; "),
        (lambda t, z: (t, z[:-1]), r"altitude_m: has 100 samples, but there are 101 time stamps"),
        (lambda t, z: (t, np.where(t > 5.0, np.nan, z)), r"altitude_m: is not a finite number at sample 51"),
        (lambda t, z: (np.where(t == t[7], np.inf, t), z), r"time_s: is not a finite number at sample 7"),
        (
            lambda t, z: (np.where(t == t[7], t[6], t), z),
            r"time_s: does not increase: 0\.6 s after 0\.6 s at sample 7",
        ),
    ],
)
def test_flights_that_cannot_be_scored_are_refused_with_field_and_reason(change, reason: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(TrajectoryError, match=reason):
        require_scorable(flight(*change(*good())), "altitude_m", 0.0, 10.0)


def test_gaps_that_a_person_accepts_are_bridged_but_the_window_must_still_be_covered() -> None:
    time_s, altitude_m = good()
    holed = flight(np.delete(time_s, [40, 41]), np.delete(altitude_m, [40, 41]))
    require_scorable(holed, "altitude_m", 0.0, 10.0, accept_gaps=True)
    with pytest.raises(TrajectoryError, match="are needed"):
        require_scorable(holed, "altitude_m", 0.0, 11.0, accept_gaps=True)


def test_a_flight_without_the_scored_channel_is_refused() -> None:
    with pytest.raises(TrajectoryError, match=r"altitude_m: is not among the recorded channels \(thrust\)"):
        require_scorable(Trajectory(good()[0], {"thrust": good()[1]}, "csv", "vehicle"), "altitude_m", 0.0, 10.0)
