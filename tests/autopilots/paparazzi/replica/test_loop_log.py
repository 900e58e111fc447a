"""The two-part comparison of the replica with a log of the loop far below its rate."""

import io

import numpy as np
import pytest

from app.autopilots.paparazzi.log import read_paparazzi
from app.autopilots.paparazzi.replica.loop_log import (
    FIELDS,
    CommandCheck,
    FlownGains,
    LoopLog,
    compare_commands,
    flown_gains,
    infer_gains,
)
from app.autopilots.paparazzi.replica.simulation import compare_simulation
from app.core.control import vertical_guidance as loop
from app.core.policy import Gains
from tests.logs.paparazzi_flights import Flight, data_of

DEFAULT = {"kp": 283, "ki": 13, "kd": 82}
TUNED = {"kp": 1624, "ki": 1356, "kd": 195}


def check_commands(log: LoopLog, gains: Gains) -> CommandCheck:
    return compare_commands(log, [FlownGains(0.0, gains)])


def loop_in(data: str) -> LoopLog:
    found = read_paparazzi(io.BytesIO(data.encode())).loop
    assert found is not None
    return found


def log_of(flight: Flight) -> LoopLog:
    return loop_in(data_of(flight))


def changed(log: LoopLog, name: str, rows: slice, by: int) -> LoopLog:
    values = log.values.copy()
    values[rows, FIELDS.index(name)] += by
    return LoopLog(log.time_s, values)


@pytest.mark.parametrize("gains", [DEFAULT, TUNED])
def test_every_command_follows_to_the_last_bit(gains: dict[str, int]) -> None:
    log = log_of(Flight(gains))
    checked = check_commands(log, gains)
    assert (checked.exact, checked.different, set(checked.stale.values())) == (checked.rows, 0, {0})
    assert checked.rows == int((~log.idle).sum()) == 669
    assert checked.passed


def test_a_state_sampled_a_step_after_its_commands_is_told_apart_from_a_difference() -> None:
    checked = check_commands(log_of(Flight(TUNED, stale=True)), TUNED)
    assert checked.passed
    assert checked.stale["state"] > 10
    assert checked.exact + sum(checked.stale.values()) == checked.rows


def test_other_gains_than_flown_are_noticed_and_the_flown_ones_named() -> None:
    log = log_of(Flight(DEFAULT))
    checked = check_commands(log, {"kp": 300, "ki": 13, "kd": 82})
    assert checked.different > 500
    assert not checked.passed
    assert checked.first_different_s is not None
    assert infer_gains(log) == DEFAULT


@pytest.mark.parametrize("name", ["ff_cmd", "fb_cmd", "thrust"])
def test_a_single_command_that_is_off_is_found(name: str) -> None:
    log = log_of(Flight(DEFAULT, fly_s=8.0))
    checked = check_commands(changed(log, name, slice(150, 151), 40), DEFAULT)
    assert checked.different == 1
    assert checked.first_different_s == log.time_s[150]


def test_feed_forward_under_a_tilt_follows_with_that_tilt() -> None:
    checked = check_commands(log_of(Flight(DEFAULT, tilt=16300, fly_s=8.0)), DEFAULT)
    assert checked.passed
    assert checked.tilted > 100
    assert checked.largest_tilt_deg == pytest.approx(np.degrees(np.arccos(16300 / 16384)), abs=0.3)


@pytest.mark.parametrize("every", [5, 26, 103])
def test_reference_and_integrator_are_simulated_again_from_the_command(every: int) -> None:
    checked = compare_simulation(log_of(Flight(DEFAULT, every=every)))
    assert checked is not None
    assert checked.passed
    assert checked.command_s == pytest.approx(15.0, abs=0.003)
    assert checked.duration_s > 33.9
    assert checked.largest_difference["z_ref"] == 0.0
    assert checked.largest_difference["z_sum_err"] < 0.001


def test_time_stamps_that_jitter_are_within_the_tolerance() -> None:
    log = log_of(Flight(TUNED))
    jitter_s = np.random.default_rng(3).uniform(-0.008, 0.008, len(log))
    checked = compare_simulation(LoopLog(log.time_s + jitter_s, log.values))
    assert checked is not None
    assert checked.passed


@pytest.mark.parametrize(("name", "by"), [("z_ref", 30), ("zd_ref", 80_000), ("zdd_ref", 900), ("z_sum_err", 40_000)])
def test_a_reference_or_an_integrator_that_goes_another_way_is_found(name: str, by: int) -> None:
    log = changed(log_of(Flight(DEFAULT)), name, slice(300, 400), by)
    checked = compare_simulation(log)
    assert checked is not None
    assert not checked.passed
    assert max(checked.largest_difference, key=lambda each: checked.largest_difference[each] > 0) == name


def test_a_log_that_begins_in_the_air_is_not_simulated() -> None:
    log = log_of(Flight(DEFAULT, fly_s=8.0))
    flying = ~log.idle
    assert compare_simulation(LoopLog(log.time_s[flying], log.values[flying])) is None


def test_the_integrator_is_held_against_a_log_that_says_a_step_twice_too() -> None:
    log = log_of(Flight(DEFAULT))
    rows = np.sort(np.append(np.arange(len(log)), 300))
    time_s = log.time_s[rows]
    time_s[301] += 1e-5
    twice = LoopLog(time_s, log.values[rows])
    elsewhere = changed(twice, "z_sum_err", slice(400, 500), 40_000)
    checked, other = (compare_simulation(each) for each in (twice, elsewhere))
    assert checked is not None
    assert checked.largest_difference["z_sum_err"] < 0.001
    assert other is not None
    assert not other.passed


def test_an_integrator_that_never_works_has_nothing_to_be_compared() -> None:
    """A vehicle that does not notice that it flies."""
    log = log_of(Flight(DEFAULT, fly_s=8.0))
    values = log.values.copy()
    values[:, FIELDS.index("z_sum_err")] = 0
    checked = compare_simulation(LoopLog(log.time_s, values))
    assert checked is not None
    assert checked.largest_difference["z_sum_err"] == 0.0


def test_a_flight_too_calm_to_tell_gains_apart_tells_none() -> None:
    log = log_of(Flight(DEFAULT))
    hover = log.time_s > 40.0
    assert infer_gains(LoopLog(log.time_s[hover], log.values[hover])) is None


def test_neither_do_a_handful_of_samples_or_commands_beyond_any_gains() -> None:
    log = log_of(Flight(DEFAULT, fly_s=8.0))
    first = int(np.flatnonzero(~log.idle)[0])
    assert infer_gains(LoopLog(log.time_s[: first + 19], log.values[: first + 19])) is None
    values = log.values.copy()
    values[:, FIELDS.index("fb_cmd")] *= 2**16
    assert infer_gains(LoopLog(log.time_s, values)) is None


def test_an_attitude_rounded_to_one_count_above_level_is_exact() -> None:
    """As in flights of the real autopilot: r33 is computed from a quaternion whose elements are rounded."""
    checked = check_commands(log_of(Flight(DEFAULT, tilt=loop.LEVEL + 1, fly_s=8.0)), DEFAULT)
    assert (checked.exact, checked.tilted) == (checked.rows, 0)
    assert checked.rounded > 100
    assert not check_commands(log_of(Flight(DEFAULT, tilt=loop.LEVEL + 8, fly_s=8.0)), DEFAULT).passed


def flights_of(*gains: dict[str, int]) -> LoopLog:
    """Flights of 8 s one after another, the first at 15 s, then every 20 s."""
    texts = [
        data_of(Flight(each, fly_s=8.0), start_s=12.0 + 20.0 * number).splitlines()[1:]
        for number, each in enumerate(gains)
    ]
    return loop_in("\n".join(line for text in texts for line in text))


def test_every_flight_has_the_gains_that_its_commands_follow_from() -> None:
    log = flights_of(DEFAULT, TUNED, DEFAULT)
    flown = flown_gains(log, [])
    assert [each.gains for each in flown] == [DEFAULT, TUNED, DEFAULT]
    assert [each.after_s for each in flown[1:]] == pytest.approx([35.0, 55.0], abs=0.06)
    assert compare_commands(log, flown).exact == int((~log.idle).sum())


def test_a_gain_that_shows_late_in_a_flight_counts_from_its_beginning() -> None:
    """The integrator is held at zero for the first second: until then, commands follow from either ki."""
    flown = flown_gains(flights_of(DEFAULT, {**DEFAULT, "ki": 200}), [])
    assert [each.after_s for each in flown] == pytest.approx([12.0, 35.0], abs=0.06)


def test_gains_changed_in_flight_count_from_the_first_sample_that_shows_them() -> None:
    log, other = (log_of(Flight(gains)) for gains in (DEFAULT, TUNED))
    changed_at = log.time_s >= 40.0
    values = np.where(changed_at[:, np.newaxis], other.values, log.values)
    flown = flown_gains(LoopLog(log.time_s, values), [DEFAULT, TUNED, {**TUNED, "ki": 13}])
    assert [each.gains for each in flown] == [DEFAULT, TUNED]
    assert flown[1].after_s == log.time_s[~changed_at][-1]


def test_commands_that_follow_from_no_gains_are_those_of_unknown_ones() -> None:
    log = flights_of(DEFAULT, DEFAULT, TUNED)
    second = np.flatnonzero((log.time_s > 34.0) & (log.time_s < 52.0))
    spoilt = changed(log, "fb_cmd", slice(int(second[0]), int(second[-1])), 777)
    flown = flown_gains(spoilt, [])
    assert [each.gains for each in flown] == [DEFAULT, None, TUNED]
    checked = compare_commands(spoilt, flown)
    assert checked.different == int((~spoilt.idle)[second[:-1]].sum()) > 100


def test_a_loop_that_was_never_in_control_has_no_gains() -> None:
    log = log_of(Flight(DEFAULT, fly_s=8.0))
    assert flown_gains(log.part(log.idle), [DEFAULT]) == []


def test_a_log_of_other_commands_from_its_first_sample_on_has_no_gains() -> None:
    log = changed(log_of(Flight(DEFAULT, fly_s=8.0)), "fb_cmd", slice(None), 777)
    assert [each.gains for each in flown_gains(log, [DEFAULT])] == [None]
