import io

import numpy as np
import pytest

from app.autopilots.log_readers import read_takeoff
from app.core.models.set_points import SetPoints
from app.core.records.flight_events import flight_events, pinned_notes
from app.core.records.trajectory import Samples, Trajectory
from tests.logs.recorded import TLOGS, recorded

TIME_S = np.arange(-1.0, 11.0)


def events_of(**channels: Samples) -> list[tuple[float, str]]:
    found = flight_events(Trajectory(TIME_S, channels, "jsbsim", "simulation"))
    return [(event.time_s, event.name) for event in found]


def test_a_completed_takeoff_has_its_command_and_its_lift_off() -> None:
    altitude_m = np.clip(TIME_S - 1.0, 0.0, 3.0)
    assert events_of(altitude_m=altitude_m, set_point_m=np.where(TIME_S >= 0, 3.0, 0.0)) == [
        (0.0, "Command"),
        (2.0, "Lift-off"),
    ]


def test_lift_off_and_landing_count_from_where_it_stood_at_the_command() -> None:
    """Paparazzi stands at 0.09 … 0.11 m above its origin."""
    altitude_m = 0.11 + np.interp(TIME_S, [2, 4, 6, 8], [0.0, 3.0, 3.0, 0.0])
    assert events_of(altitude_m=altitude_m) == [(0.0, "Command"), (3.0, "Lift-off"), (8.0, "Landing")]


@pytest.mark.parametrize("name", TLOGS)
def test_the_recorded_paparazzi_lifts_off_after_its_command(name: str) -> None:
    flown = read_takeoff(io.BytesIO(recorded(f"{name}.tlog"))).trajectory
    [lift_off] = [event.time_s for event in flight_events(flown) if event.name == "Lift-off"]
    assert 0.2 < lift_off < 0.8


def test_an_aborted_flight_shows_when_its_set_point_returned_to_the_ground_and_when_it_landed() -> None:
    altitude_m = np.interp(TIME_S, [0, 3, 8], [0.0, 3.0, 0.0])
    set_point_m = np.where((TIME_S >= 0) & (TIME_S < 4), 3.0, 0.0)
    assert events_of(altitude_m=altitude_m, set_point_m=set_point_m) == [
        (0.0, "Command"),
        (1.0, "Lift-off"),
        (4.0, "Abort"),
        (8.0, "Landing"),
    ]


@pytest.mark.parametrize(
    ("aborted_s", "shown"),
    [(np.inf, [(5.0, "Push"), (8.0, "End of push")]), (6.0, [(5.0, "Push"), (6.0, "Abort")]), (4.0, [(4.0, "Abort")])],
)
def test_a_push_is_shown_until_an_abort(aborted_s: float, shown: list[tuple[float, str]]) -> None:
    set_points = SetPoints((0.0, 2.0, 5.0, 8.0), (3.0, 2.0, 2.0, 2.0), (0.0, 0.0, -2.0, 0.0))
    channels = {
        "altitude_m": np.where(TIME_S > 0.0, 3.0, 0.0),
        "set_point_m": np.where((TIME_S >= 0.0) & (aborted_s > TIME_S), 3.0, 0.0),
    }
    found = flight_events(Trajectory(TIME_S, channels, "px4", "vehicle"), planned=set_points.pushes)
    assert [(event.time_s, event.name) for event in found if event.name not in {"Command", "Lift-off"}] == shown


def test_a_vehicle_that_stays_on_the_ground_has_only_a_command() -> None:
    assert events_of(altitude_m=np.zeros_like(TIME_S), set_point_m=np.zeros_like(TIME_S)) == [(0.0, "Command")]
    assert events_of(pitch_rad=np.zeros_like(TIME_S)) == [(0.0, "Command")]


def test_the_lines_of_a_note_that_begin_with_a_time_are_pinned_to_it() -> None:
    note = "Windy today.\n 12.5 s: gust from the door\n2 s – first wobble\n-0.5s: props still\nthe 3 s: no pin\n4 s:"
    assert [(event.time_s, event.name) for event in pinned_notes(note)] == [
        (-0.5, "props still"),
        (2.0, "first wobble"),
        (12.5, "gust from the door"),
    ]


def test_a_lost_link_is_an_event_with_its_length_and_a_slow_log_has_none() -> None:
    def named(*removed: tuple[float, float], interval_s: float = 0.1) -> list[tuple[float, str]]:
        time_s = np.arange(-1.0, 20.0, interval_s)
        for begin_s, end_s in removed:
            time_s = time_s[(time_s <= begin_s + 1e-6) | (time_s >= end_s - 1e-6)]
        record = Trajectory(time_s, {"altitude_m": np.zeros_like(time_s)}, "mavlink", "vehicle")
        return [(round(event.time_s, 2), event.name) for event in flight_events(record)]

    command = (0.0, "Command")
    assert named((2.0, 2.9)) == [command]
    assert named((2.0, 4.3), (9.0, 10.5)) == [command, (2.0, "No data for 2.3 s"), (9.0, "No data for 1.5 s")]
    assert named((2.0, 4.0), (6.0, 8.0), (9.0, 11.0), (13.0, 15.0)) == [command, (2.0, "No data, 4 times")]
    assert named(interval_s=1.5) == [command]


def test_a_record_of_a_single_sample_has_no_gap() -> None:
    record = Trajectory(np.zeros(1), {"altitude_m": np.zeros(1)}, "mavlink", "vehicle")
    assert [event.name for event in flight_events(record)] == ["Command"]


def test_a_gap_is_not_a_glitch_as_well() -> None:
    time_s = np.array([-1.0, 0.0, 0.5, 1.0, 4.0, 4.5, 5.0])
    record = Trajectory(time_s, {"altitude_m": np.zeros_like(time_s)}, "mavlink", "vehicle")
    found = [(event.time_s, event.name) for event in flight_events(record, [1.0, 4.0])]
    assert found == [(0.0, "Command"), (1.0, "No data for 3.0 s"), (4.0, "Glitch")]


def test_glitches_are_events_and_many_of_them_are_one() -> None:
    def named(*begin_s: float) -> list[tuple[float, str]]:
        record = Trajectory(TIME_S, {"altitude_m": np.zeros_like(TIME_S)}, "mavlink", "vehicle")
        return [(event.time_s, event.name) for event in flight_events(record, begin_s)]

    assert named(5.0, 2.5) == [(0.0, "Command"), (2.5, "Glitch"), (5.0, "Glitch")]
    assert named(5.0, 6.0, 4.0, 7.0) == [(0.0, "Command"), (4.0, "4 glitches")]
