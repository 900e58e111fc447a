from app.autopilots.measurements import Battery, FenceBreach, Position
from app.vehicles.mavlink.observation import TrialObservation
from tests.vehicles.mavlink.monitors.observing import START_S, failure_of, told, watch_of
from tests.vehicles.mavlink.walking import PLAN


def envelope(watch: TrialObservation, *, settling: bool = True) -> str | None:
    return failure_of(watch.envelope.find(PLAN, watch.last, settling=settling))


def test_the_corridor_is_measured_from_the_ground_and_speed_is_limited_in_both_directions() -> None:
    assert (envelope(watch_of(4.59)), envelope(watch_of(4.61))) == (None, "F6")
    rates_m_s = (-4.1, -3.97, 3.97, 4.1)
    assert [envelope(watch_of(2.0, climb_rate_m_s=each)) for each in rates_m_s] == ["F6", None, None, "F6"]


def test_drifting_away_is_limited() -> None:
    watch = TrialObservation.begin(START_S, last=Position(9.98, 3.0, 0.0))
    watch, _ = watch.update(Position(10.0, 3.0, 0.0, 3.0, 4.1), 10.0, PLAN)
    assert envelope(watch) == "F6"


def test_four_crossings_of_the_set_point_are_an_oscillation_and_three_are_not() -> None:
    swing = [2.6, 3.4, 2.6, 3.4]
    assert envelope(watch_of(*swing, every_s=1.0)) is None
    assert envelope(watch_of(*swing, 2.6, every_s=1.0)) == "F6"
    assert envelope(watch_of(*swing, 2.6, every_s=1.0), settling=False) is None


def test_ripples_within_the_band_are_no_crossings() -> None:
    assert watch_of(*[2.75, 3.25] * 20, every_s=0.2).envelope.crossings == 0


def test_the_vehicles_own_fence_counts() -> None:
    watch = told(watch_of(3.0), FenceBreach("its greatest altitude"), at_s=10.1)
    assert (envelope(watch), watch.envelope.breached) == ("F6", "its greatest altitude")


def test_a_speed_beyond_reason_that_lasts_is_an_abort() -> None:
    watch = watch_of(3.0, 3.0)
    for at_s, altitude_m in ((10.04, 3.14), (10.06, 3.28)):
        watch, _ = watch.update(Position(at_s, altitude_m, 7.0), at_s, PLAN)
    assert envelope(watch) == "F6"


def test_a_lone_speed_beyond_reason_is_no_abort() -> None:
    watch = watch_of(3.0, 3.0)
    watch, kept = watch.update(Position(10.04, 3.0, 7.0), 10.04, PLAN)
    assert (kept, envelope(watch)) == ((), None)


def test_a_battery_is_low_after_a_second_below_the_limit() -> None:
    watch = told(watch_of(3.0), Battery(10.4), at_s=10.1)
    assert watch.battery.find(11.1) is None
    assert failure_of(watch.battery.find(11.2)) == "F7"
    assert told(watch, Battery(10.6), at_s=10.9).battery.find(11.2) is None


def test_a_battery_without_a_reading_for_ten_seconds_counts_as_low() -> None:
    watch = told(watch_of(3.0), Battery(12.0), at_s=10.1)
    assert watch.battery.find(20.0) is None
    assert failure_of(watch.battery.find(20.2)) == "F7"
