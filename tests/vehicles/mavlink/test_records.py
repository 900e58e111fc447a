"""Records of both sources, made of a synthetic climb that each watches by its own clock."""

from collections.abc import Sequence

import numpy as np
import pytest

from app.autopilots.measurements import Position
from app.core.experiments.takeoff import Takeoff
from app.core.records.glitches import find_glitches
from app.core.records.trajectory import Samples, Trajectory
from app.vehicles.mavlink.events import RecordSample
from app.vehicles.mavlink.records import add_secondary_altitude, trajectory_of

ZERO_S = 700.0
"""The record's time 0 on the ground's clock."""
LATE_S = 0.035
TIME_S = np.arange(-1.0, 33.0, 1.0 / 51.2)


def climb_m(time_s: Samples) -> Samples:
    flown = np.clip(time_s - 0.4, 0.0, None)
    return 3.0 * (1.0 - np.exp(-flown) * (np.cos(2.0 * flown) + 0.5 * np.sin(2.0 * flown)))


def own_record(top_m: float = 3.0) -> Trajectory:
    """The vehicle's, whose set point falls to the ground at 30 s."""
    channels = {
        "altitude_m": climb_m(TIME_S) * top_m / 3.0,
        "climb_rate_m_s": np.gradient(climb_m(TIME_S), TIME_S),
        "set_point_m": np.where(TIME_S < 30.0, 3.0, 0.0),
    }
    return Trajectory(TIME_S, channels, "mavlink", "vehicle")


def sightings(apart_m: Samples | float = 0.0, *, top_m: float = 3.0) -> list[tuple[float, float]]:
    """A hundred a second, 0.11 m too high, seen late; `apart_m` away from the truth besides."""
    seen_s = np.arange(-2.5, 35.0, 0.01)
    noise_m = 0.001 * np.random.default_rng(3).standard_normal(len(seen_s))
    altitude_m = climb_m(seen_s) * top_m / 3.0 + 0.11 + noise_m + apart_m
    return list(zip((ZERO_S + seen_s + LATE_S).tolist(), altitude_m.tolist(), strict=True))


def unseen(seen: Sequence[tuple[float, float]], from_s: float, until_s: float) -> list[tuple[float, float]]:
    """The cameras lose sight of the vehicle for a while."""
    return [each for each in seen if not from_s <= each[0] - ZERO_S < until_s]


def test_the_vehicle_s_altitude_is_scored_and_the_cameras_are_beside_it() -> None:
    own = own_record()
    both = add_secondary_altitude(own, sightings(), name="motion capture", zero_s=ZERO_S, scored="vehicle")
    assert both.remark == ""
    assert both.trajectory["altitude_m"] is own["altitude_m"]
    np.testing.assert_allclose(both.trajectory["altitude_2_m"], own["altitude_m"], atol=0.02)
    assert both.settings["second_delay_s"] == pytest.approx(LATE_S, abs=0.005)
    assert float(both.settings["second_largest_m"]) < 0.02
    assert float(both.settings["second_rms_m"]) < 0.003


def test_the_cameras_altitude_is_scored_on_their_own_times_and_the_vehicle_is_beside_it() -> None:
    both = add_secondary_altitude(
        own_record(), sightings(), name="motion capture", zero_s=ZERO_S, scored="mocap"
    ).trajectory
    np.testing.assert_allclose(np.diff(both.time_s), 0.01, atol=2e-6)
    assert both.time_s[0] == pytest.approx(-1.0, abs=0.01)
    assert both.time_s[-1] == pytest.approx(33.0, abs=0.04)
    np.testing.assert_allclose(both["altitude_m"], climb_m(both.time_s), atol=0.02)
    np.testing.assert_allclose(both["altitude_2_m"], climb_m(both.time_s), atol=0.002)
    assert set(np.unique(both["set_point_m"])) == {0.0, 3.0}
    assert Takeoff().error(both) == pytest.approx(Takeoff().error(own_record()), rel=0.01)


def test_a_drifting_source_is_described_and_shown_as_a_glitch() -> None:
    drift_m = np.interp(np.arange(-2.5, 35.0, 0.01), (10.0, 14.0, 14.1), (0.0, 0.5, 0.0))
    both = add_secondary_altitude(
        own_record(), sightings(drift_m), name="motion capture", zero_s=ZERO_S, scored="vehicle"
    )
    assert "The vehicle and motion capture disagree: up to 0.5" in both.remark
    assert "at 14.0 s" in both.remark
    assert both.settings["second_largest_m"] == pytest.approx(0.5, abs=0.02)
    assert [glitch.kind for glitch in find_glitches(Takeoff(), both.trajectory)] == ["disagreement"]


def test_what_the_cameras_did_not_see_is_missing_where_they_are_scored_and_told_where_they_are_not() -> None:
    seen = unseen(sightings(), 20.0, 21.2)
    beside = add_secondary_altitude(own_record(), seen, name="motion capture", zero_s=ZERO_S, scored="vehicle")
    assert beside.remark == "Motion capture has no samples for 1.2 s from 20.0 s on."
    np.testing.assert_allclose(beside.trajectory["altitude_2_m"], climb_m(TIME_S), atol=0.02)
    scored = add_secondary_altitude(own_record(), seen, name="motion capture", zero_s=ZERO_S, scored="mocap")
    assert [glitch.kind for glitch in find_glitches(Takeoff(), scored.trajectory)] == ["gap"]


def test_a_flight_with_little_motion_is_aligned_by_arrival_and_its_record_says_so() -> None:
    low = sightings(top_m=0.1)
    both = add_secondary_altitude(own_record(0.1), low, name="motion capture", zero_s=ZERO_S, scored="vehicle")
    assert "aligned by its time of receipt alone: the two moved by less than 0.3 m" in both.remark
    assert both.settings["second_delay_s"] == 0.0
    np.testing.assert_allclose(both.trajectory["altitude_2_m"], climb_m(TIME_S) / 30.0, atol=0.02)


@pytest.mark.parametrize(
    "seen", [[], unseen(sightings(), -10.0, 100.0), sightings()[:1]], ids=["silent", "blind", "one glance"]
)
def test_a_source_that_saw_nothing_leaves_the_record_as_it_is(seen: list[tuple[float, float]]) -> None:
    own = own_record()
    both = add_secondary_altitude(own, seen, name="motion capture", zero_s=ZERO_S, scored="mocap")
    assert both.trajectory is own
    assert both.remark.startswith("No altitudes came from motion capture, the second source;")


def reported(*references_m: float | None) -> list[RecordSample]:
    """A sample every tenth of a second at 2.9 m, with what the autopilot reported of its reference."""
    return [
        RecordSample(
            Position(time_boot_s=40.0 + 0.1 * number, altitude_m=2.9, climb_rate_m_s=0.0, north_m=0.0, east_m=0.0),
            set_point_m=3.0,
            battery_v=None,
            reference_m=reference_m,
        )
        for number, reference_m in enumerate(references_m)
    ]


def test_reports_of_the_reference_that_come_late_do_not_cost_the_flight() -> None:
    """Seen: one sample in 2000 had none, after a stall of this computer, and the flight could not be scored."""
    record = trajectory_of(reported(None, 3.0, None, 3.2, None), 40.0, 0.0, referred_from_s=0.1)
    np.testing.assert_allclose(record["reference_m"], [2.9, 3.0, 3.1, 3.2, 3.2])


@pytest.mark.parametrize("samples", [reported(3.0, None, None, None, 3.0), reported(3.0, None, None, None)])
def test_a_reference_that_was_not_reported_for_longer_is_not_invented(samples: list[RecordSample]) -> None:
    assert "reference_m" not in trajectory_of(samples, 40.0, 0.0, referred_from_s=0.0).channels
