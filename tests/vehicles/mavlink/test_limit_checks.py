from dataclasses import replace

import pytest

from app.autopilots.measurements import Battery, FenceBreach, Heartbeat, Measurement, Position
from app.vehicles.mavlink import limit_checks
from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.observation import TrialObservation
from tests.vehicles.mavlink.walking import GROUND_M, LIMITS

START_S = 10.0


def watch_of(*altitudes_m: float, every_s: float = 0.02, climb_rate_m_s: float = 0.0) -> TrialObservation:
    """What is remembered of these altitudes, one after the other from 10 s on."""
    watch = watching.begin(START_S)
    for number, altitude_m in enumerate(altitudes_m):
        at_s = START_S + number * every_s
        watch, _ = watching.update(watch, Position(at_s, altitude_m, climb_rate_m_s), at_s, LIMITS)
    return watch


def told(watch: TrialObservation, *measurements: Measurement | None, at_s: float) -> TrialObservation:
    for measurement in measurements:
        watch, _ = watching.update(watch, measurement, at_s, LIMITS)
    return watch


def envelope(watch: TrialObservation, *, settling: bool = True) -> str | None:
    finding = limit_checks.find_envelope(watch, LIMITS, ground_m=GROUND_M, settling=settling)
    return None if finding is None else finding.why


def test_a_hover_keeps_every_limit() -> None:
    watch = told(watch_of(3.0, 3.0, 3.0), Heartbeat(9, True, "4"), Battery(12.4), at_s=10.05)
    assert envelope(watch) is None
    assert limit_checks.find_link(watch, LIMITS, 10.1) is None
    assert limit_checks.find_frozen(watch, LIMITS, 10.3) is None
    assert limit_checks.find_battery(watch, 10.1) is None
    assert limit_checks.find_unexpected(watch, LIMITS, LIMITS.flying_modes) is None


def test_the_corridor_is_measured_from_the_ground_under_the_vehicle() -> None:
    assert envelope(watch_of(4.59)) is None
    assert envelope(watch_of(4.61)) == "It was 4.51 m above the ground; the limit is 4.5 m."


@pytest.mark.parametrize("climb_rate_m_s", [4.1, -4.1])
def test_speed_is_limited_in_both_directions(climb_rate_m_s: float) -> None:
    assert (
        envelope(watch_of(2.0, climb_rate_m_s=climb_rate_m_s))
        == f"Its climb rate was {climb_rate_m_s:+g} m/s; the limit is ±4 m/s."
    )
    assert envelope(watch_of(2.0, climb_rate_m_s=climb_rate_m_s * 0.97)) is None


def test_drifting_away_is_limited() -> None:
    watch = watching.begin(START_S, last=Position(9.98, 3.0, 0.0))
    watch, _ = watching.update(watch, Position(10.0, 3.0, 0.0, 3.0, 4.1), 10.0, LIMITS)
    assert envelope(watch) == "It was 5.1 m from its start; the limit is 5 m."


def test_four_crossings_of_the_set_point_are_an_oscillation_and_three_are_not() -> None:
    swing = [2.6, 3.4, 2.6, 3.4]
    assert envelope(watch_of(*swing, every_s=1.0)) is None
    assert envelope(watch_of(*swing, 2.6, every_s=1.0)) == "It crossed its set point 4 times by more than ±0.3 m."
    assert envelope(watch_of(*swing, 2.6, every_s=1.0), settling=False) is None


def test_ripples_within_the_band_are_no_crossings() -> None:
    assert watch_of(*[2.75, 3.25] * 20, every_s=0.2).crossings == 0


def test_the_vehicles_own_fence_counts() -> None:
    watch = told(watch_of(3.0), FenceBreach("its greatest altitude"), at_s=10.1)
    assert envelope(watch) == "The vehicle's own fence was crossed: its greatest altitude."


def test_a_lone_jump_is_dropped_and_counted() -> None:
    watch = watch_of(3.0, 3.0, 3.6)
    assert (watch.last, watch.glitches) == (Position(10.02, 3.0, 0.0), 0)
    watch, kept = watching.update(watch, Position(10.06, 3.0, 0.0), 10.06, LIMITS)
    assert kept == (Position(10.06, 3.0, 0.0),)
    assert watch.glitches == 1


def test_a_jump_that_stays_is_where_the_vehicle_is() -> None:
    watch = watch_of(3.0, 3.0, 3.6)
    watch, kept = watching.update(watch, Position(10.06, 3.6, 0.0), 10.06, LIMITS)
    assert [position.time_boot_s for position in kept] == [10.04, 10.06]
    assert watch.glitches == 0


def test_a_lone_speed_beyond_reason_is_no_abort() -> None:
    watch = watch_of(3.0, 3.0)
    watch, kept = watching.update(watch, Position(10.04, 3.0, 7.0), 10.04, LIMITS)
    assert (kept, envelope(watch)) == ((), None)


def test_a_speed_beyond_reason_that_lasts_is_an_abort() -> None:
    watch = watch_of(3.0, 3.0)
    for at_s, altitude_m in ((10.04, 3.14), (10.06, 3.28)):
        watch, _ = watching.update(watch, Position(at_s, altitude_m, 7.0), at_s, LIMITS)
    assert envelope(watch) == "Its climb rate was +7.0 m/s; the limit is ±4 m/s."


def test_more_than_three_glitches_are_too_many() -> None:
    watch = watch_of(*[3.0, 3.0, 3.6] * 3, 3.0)
    assert (watch.glitches, watching.too_many_glitches(watch)) == (3, False)
    assert watching.too_many_glitches(replace(watch, glitches=4))


def test_a_second_without_any_packet_is_a_lost_link() -> None:
    watch = watch_of(3.0)
    assert limit_checks.find_link(watch, LIMITS, 11.0) is None
    lost = limit_checks.find_link(watch, LIMITS, 11.01)
    assert lost is not None
    assert lost.failure is Failure.LINK


def test_any_packet_keeps_the_link_but_three_missed_heartbeats_lose_it() -> None:
    watch = told(watch_of(3.0), None, at_s=11.7)
    assert limit_checks.find_link(watch, LIMITS, 11.74) is None
    lost = limit_checks.find_link(watch, LIMITS, 11.8)
    assert lost is not None
    assert lost.why == "Three heartbeats were missed."


def repeated(watch: TrialObservation, *, until_s: float) -> TrialObservation:
    """The last position again and again, 50 times a second."""
    for tick in range(1, round((until_s - START_S) * 50) + 1):
        watch = told(watch, Position(START_S, 3.0, 0.0), at_s=START_S + tick * 0.02)
    return watch


def test_a_clock_that_stands_still_among_packets_is_frozen() -> None:
    assert limit_checks.find_frozen(repeated(watch_of(3.0), until_s=10.24), LIMITS, 10.3) is None
    frozen = limit_checks.find_frozen(repeated(watch_of(3.0), until_s=10.28), LIMITS, 10.3)
    assert frozen is not None
    assert (frozen.failure, frozen.why) == (Failure.FROZEN, "Its clock stood still for more than 0.25 s.")


def test_what_a_stall_delayed_may_come_in_any_order() -> None:
    watch = told(watch_of(3.0), Heartbeat(9, True, "4"), Battery(12.4), at_s=10.8)
    assert limit_checks.find_frozen(watch, LIMITS, 10.3) is None


def test_a_position_that_stays_away_among_other_packets_is_frozen_too() -> None:
    watch = watch_of(3.0)
    for beat in range(1, 4):
        watch = told(watch, Heartbeat(9, True, "4"), at_s=10.0 + beat * 0.5)
    assert limit_checks.find_frozen(watch, LIMITS, 10.3) is not None


def test_silence_alone_is_not_frozen() -> None:
    watch = watch_of(3.0, 3.0)
    watch, _ = watching.update(watch, Position(10.9, 3.0, 0.0), 10.9, LIMITS)
    assert limit_checks.find_frozen(watch, LIMITS, 10.3) is None


def test_a_packet_that_was_overtaken_is_left_out_and_a_clock_that_falls_back_is_a_reboot() -> None:
    watch = told(watch_of(3.0, 3.0), Position(10.0, 3.0, 0.0), at_s=10.03)
    assert limit_checks.find_unexpected(replace(watch, armed=True), LIMITS, frozenset()) is None
    watch = told(watch, Position(0.5, 3.0, 0.0), at_s=10.04)
    assert limit_checks.find_unexpected(replace(watch, armed=True), LIMITS, frozenset()) is None
    watch = told(watch, Position(0.7, 3.0, 0.0), at_s=10.24)
    watch = told(watch, Position(0.92, 3.0, 0.0), at_s=10.46)
    reboot = limit_checks.find_unexpected(replace(watch, armed=True), LIMITS, frozenset())
    assert reboot is not None
    assert reboot.why == "The vehicle rebooted."


def test_a_battery_is_low_after_a_second_below_the_limit() -> None:
    watch = told(watch_of(3.0), Battery(10.4), at_s=10.1)
    assert limit_checks.find_battery(watch, 11.1) is None
    assert limit_checks.find_battery(watch, 11.2) is not None
    assert limit_checks.find_battery(told(watch, Battery(10.6), at_s=10.9), 11.2) is None


def test_a_battery_without_a_reading_for_ten_seconds_counts_as_low() -> None:
    watch = told(watch_of(3.0), Battery(12.0), at_s=10.1)
    assert limit_checks.find_battery(watch, 20.0) is None
    silent = limit_checks.find_battery(watch, 20.2)
    assert silent is not None
    assert silent.why == "No battery voltage was received for 10 s."


def beating(*beats: Heartbeat) -> TrialObservation:
    """What is remembered of these heartbeats, as far apart as Paparazzi's."""
    watch = told(watch_of(3.0), Heartbeat(9, True, "4"), at_s=10.0)
    for number, beat in enumerate(beats, start=1):
        watch = told(watch, beat, at_s=10.0 + 0.5 * number)
    return watch


def test_a_disarming_and_a_strange_mode_are_unexpected_once_heartbeats_agree() -> None:
    disarmed, strange = Heartbeat(9, False, "4"), Heartbeat(9, True, "0")
    named = replace(LIMITS, mode_names={"0": "Failsafe"})
    for beat, why in (
        (disarmed, "The vehicle disarmed itself in the air."),
        (strange, "The vehicle entered mode Failsafe."),
    ):
        found = [
            limit_checks.find_unexpected(beating(*[beat] * count), named, LIMITS.flying_modes) for count in (1, 2, 3)
        ]
        assert found[:2] == [None, None]
        assert found[2] is not None
        assert found[2].why == why


def test_a_mode_in_which_a_person_flies_is_a_take_over() -> None:
    named = replace(LIMITS, mode_names={"64": "Manual"})
    taken = limit_checks.find_taken_over(beating(*[Heartbeat(9, True, "64")] * 3), named)
    assert taken is not None
    assert (taken.failure, taken.why) == (Failure.TAKEN_OVER, "The vehicle entered mode Manual.")
    assert limit_checks.find_taken_over(beating(*[Heartbeat(9, False, "64")] * 3), named) is None


def test_the_ground_takes_height_and_speed_and_a_fresh_sample() -> None:
    resting = watch_of(0.2, 0.2)
    assert watching.is_grounded(resting, 10.1, GROUND_M)
    assert not watching.is_grounded(resting, 10.6, GROUND_M)
    assert not watching.is_grounded(watch_of(0.26, 0.26), 10.1, GROUND_M)
    assert not watching.is_grounded(watch_of(0.2, 0.2, climb_rate_m_s=0.2), 10.1, GROUND_M)
