from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.autopilots.registry import get_experiment
from app.core.policy import Gains
from app.core.records.glitches import find_glitches, repaired
from app.core.records.trajectory import Samples, Trajectory
from app.logs.takeoff_csv import read_takeoff_csv
from app.vehicles.base import FlightOptions, OptionValue
from app.vehicles.flight_end import StopRequest
from app.vehicles.registry import open_vehicle
from tests.core.tuning.flying import TAKEOFF, compiled_only

DATA = Path(__file__).parents[2] / "data"
DEFAULT: Gains = {"kp": 283, "ki": 13, "kd": 82}
TUNED: Gains = {"kp": 1600, "ki": 1023, "kd": 127}
Channels = dict[str, Samples]


def flown(kind: str, options: dict[str, OptionValue], gains: Gains, *, abort_after: int | None = None) -> Trajectory:
    """As stored; `abort_after` so many questions, one every 20 ms."""
    asked = iter(range(10**6))

    def should_stop() -> StopRequest | None:
        return StopRequest("that is enough") if abort_after is not None and next(asked) >= abort_after else None

    with open_vehicle(kind, options, safe_gains=DEFAULT) as vehicle:
        vehicle.stage(gains)
        record = vehicle.fly(FlightOptions(seed=3), on_sample=lambda _: None, should_stop=should_stop)
    return record.trajectory.as_stored()


def model_run(rate_hz: float = 64.0) -> Trajectory:
    """A takeoff as a telemetry link brings it, cheap enough for the interpreter: a rise to 3 m, with a slow sway."""
    time_s = np.arange(0.0, 33.0, 1.0 / rate_hz)
    climbing = np.clip(time_s - 1.0, 0.0, None)
    altitude_m = 3.0 * (1.0 - np.exp(-climbing)) + 0.02 * np.sin(2.0 * climbing)
    channels = {"altitude_m": altitude_m, "climb_rate_m_s": np.gradient(altitude_m, time_s)}
    return Trajectory(time_s, channels, "test", "vehicle").as_stored()


def altered(record: Trajectory, alter: Callable[[Samples, Channels], None]) -> Trajectory:
    channels = {name: values.copy() for name, values in record.channels.items()}
    alter(record.time_s, channels)
    return replace(record, channels=channels)


def spike(time_s: Samples, channels: Channels) -> None:
    channels["altitude_m"][(time_s >= 5.0) & (time_s < 5.1)] += 0.4


def hold(time_s: Samples, channels: Channels) -> None:
    held = (time_s >= 2.0) & (time_s < 3.0)
    channels["altitude_m"][held] = channels["altitude_m"][held][0]


def hold_everything(time_s: Samples, channels: Channels) -> None:
    held = (time_s >= 20.0) & (time_s < 21.0)
    for values in channels.values():
        values[held] = values[held][0]


def second_source(time_s: Samples, channels: Channels) -> None:
    channels["altitude_2_m"] = channels["altitude_m"] + 0.1
    channels["altitude_2_m"][(time_s >= 7.0) & (time_s < 8.0)] += 0.5
    channels["altitude_2_m"][np.argmin(np.abs(time_s - 15.0))] += 0.5


@pytest.mark.parametrize(
    ("alter", "kind", "start_s", "end_s", "sentence"),
    [
        (spike, "acceleration", 5.0, 5.1, "A jump of +0.40 m at 5.00 s, and back 0.1"),
        (hold, "frozen", 2.0, 3.0, "The same 1.91 m for 0.98 s from 2.00 s on"),
        (hold_everything, "frozen", 20.0, 21.0, "no vehicle in the air is that steady"),
        (second_source, "disagreement", 7.0, 8.0, "The two sources differ by up to 0.50 m more than elsewhere"),
    ],
)
def test_what_no_vehicle_can_have_flown_is_found_where_it_is(
    alter: Callable[[Samples, Channels], None], kind: str, start_s: float, end_s: float, sentence: str
) -> None:
    (found,) = find_glitches(TAKEOFF, altered(model_run(), alter))
    assert found.kind == kind
    assert (found.start_s, found.end_s) == pytest.approx((start_s, end_s), abs=0.02)
    assert sentence in found.sentence


def test_a_repair_takes_a_spike_out_and_leaves_the_record_alone() -> None:
    clean = model_run()
    bad = altered(clean, spike)
    before = bad["altitude_m"].copy()
    mended = repaired(TAKEOFF, bad, find_glitches(TAKEOFF, bad))
    assert TAKEOFF.error(bad) == pytest.approx(TAKEOFF.error(clean) + 0.4 * 0.1 / 32.6, abs=2e-4)
    assert TAKEOFF.error(mended) == pytest.approx(TAKEOFF.error(clean), abs=1e-5)
    np.testing.assert_array_equal(bad["altitude_m"], before)
    np.testing.assert_array_equal(mended["climb_rate_m_s"], bad["climb_rate_m_s"])


def test_samples_held_while_the_link_says_nothing_else_are_told_by_the_jump_at_their_end() -> None:
    alone = altered(model_run(), hold)
    alone = replace(alone, channels={"altitude_m": alone["altitude_m"]})
    (found,) = find_glitches(TAKEOFF, alone)
    assert found.kind == "frozen"
    assert (found.start_s, found.end_s) == pytest.approx((2.0, 3.0), abs=0.02)


def test_a_datum_that_moves_up_and_down_again_later_is_two_jumps() -> None:
    def move(time_s: Samples, channels: Channels) -> None:
        channels["altitude_m"][(time_s >= 12.0) & (time_s < 20.0)] += 0.3

    found = find_glitches(TAKEOFF, altered(model_run(), move))
    assert [glitch.start_s for glitch in found] == pytest.approx([12.0, 20.0], abs=0.02)


def test_a_datum_that_moves_is_named_and_cannot_be_repaired() -> None:
    def move(time_s: Samples, channels: Channels) -> None:
        channels["altitude_m"][time_s >= 12.0] += 0.3

    bad = altered(model_run(), move)
    (found,) = find_glitches(TAKEOFF, bad)
    assert found.sentence == "A jump of +0.30 m at 12.00 s: no thrust can accelerate a vehicle that much."
    np.testing.assert_array_equal(repaired(TAKEOFF, bad, (found,))["altitude_m"], bad["altitude_m"])


def test_a_gap_is_a_glitch_and_a_straight_line_its_repair() -> None:
    record = model_run()
    kept = (record.time_s < 3.0) | (record.time_s >= 3.5)
    channels = {name: values[kept] for name, values in record.channels.items()}
    gappy = replace(record, time_s=record.time_s[kept], channels=channels)
    (found,) = find_glitches(TAKEOFF, gappy)
    assert (found.kind, found.sentence) == ("gap", "No samples for 0.52 s after 2.98 s.")
    assert TAKEOFF.error(repaired(TAKEOFF, gappy, (found,)), accept_gaps=True) == pytest.approx(
        TAKEOFF.error(record), abs=1e-3
    )


def test_standing_on_the_ground_is_not_frozen() -> None:
    """Before the takeoff, and after a landing at half a metre a second, which ends from one sample to the next."""
    record = model_run()
    altitude_m = np.where(record.time_s < 15.0, record["altitude_m"], 3.0 - 0.5 * (record.time_s - 15.0)).clip(0.0)
    landed = Trajectory(record.time_s, {"altitude_m": altitude_m + 0.1}, "test", "vehicle").as_stored()
    assert find_glitches(TAKEOFF, landed) == ()


def test_records_that_cannot_be_scored_are_left_to_the_scoring() -> None:
    record = model_run()
    backwards = replace(record, time_s=record.time_s[::-1])
    short = replace(record, time_s=record.time_s[:2], channels={"altitude_m": record["altitude_m"][:2]})
    nameless = replace(record, channels={})
    assert [find_glitches(TAKEOFF, one) for one in (backwards, short, nameless)] == [(), (), ()]


def test_other_outputs_are_looked_at_for_gaps_only() -> None:
    experiment = get_experiment("pitch-tracking")
    time_s = np.concatenate((np.arange(0.0, 20.0, 0.02), np.arange(21.0, 60.0, 0.02)))
    record = Trajectory(time_s, {experiment.output: np.zeros_like(time_s)}, "test", "simulation")
    assert [found.kind for found in find_glitches(experiment, record)] == ["gap"]


@compiled_only
@pytest.mark.parametrize(
    "gains",
    [
        TUNED,
        *(pytest.param(each, marks=pytest.mark.complete) for each in (DEFAULT, {"kp": 1500, "ki": 1000, "kd": 40})),
    ],
)
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("twin", {}),
        ("twin", {"scatter": 0.0}),
        ("twin", {"scatter": 5.0}),
        ("twin", {"hover_throttle": 0.9}),
        ("jsbsim", {}),
        ("jsbsim", {"gust_m_s": 3.0, "altitude_noise_m": 0.1}),
    ],
)
def test_flights_of_simulated_vehicles_have_no_glitches(
    kind: str, options: dict[str, OptionValue], gains: Gains
) -> None:
    """Also with gains that swing more and more, one that hardly lifts off, and one that is aborted and lands."""
    assert find_glitches(TAKEOFF, flown(kind, options, gains)) == ()
    assert find_glitches(TAKEOFF, flown(kind, options, gains, abort_after=150)) == ()


@pytest.mark.parametrize("name", ["paparazzi_283_13_82.csv", "paparazzi_1624_1356_195.csv"])
def test_recorded_takeoffs_have_no_glitches(name: str) -> None:
    """51 Hz, altitude in steps of 1/256 m, stamps in milliseconds."""
    record = read_takeoff_csv((DATA / "takeoffs" / name).read_bytes())
    assert find_glitches(TAKEOFF, record) == ()
