import numpy as np
import pytest

from app.vehicles.mavlink.altitude_sources import AltitudeSource, ClockOffset, Pose


def put(stream: AltitudeSource, time_s: float, altitude_m: float, *, arrived_s: float | None = None) -> None:
    arrived_s = time_s if arrived_s is None else arrived_s
    stream.put(Pose(time_s, altitude_m, (altitude_m,), tracking_valid=True), arrived_s)


def test_a_frame_that_was_held_up_is_dated_as_if_it_had_not_been() -> None:
    arrivals = ClockOffset()
    held_up_s = (0.003, 0.001, 0.004, 0.050, 0.041, 0.002)
    sent_s = [100.0 + 0.01 * place for place in range(len(held_up_s))]
    dated_s = [arrivals.measured_s(at, at - 60.0 + late) for at, late in zip(sent_s, held_up_s, strict=True)]
    assert dated_s[1:] == pytest.approx([at - 60.0 + 0.001 for at in sent_s[1:]])


def test_a_source_whose_messages_wait_for_seconds_is_dated_by_its_own_clock_all_the_while() -> None:
    arrivals = ClockOffset()
    waited_s = np.interp(np.arange(2000), (0, 500, 1000, 2000), (0.0, 0.0, 3.0, 3.0))
    dated_s = [arrivals.measured_s(0.01 * place, 70.0 + 0.01 * place + late) for place, late in enumerate(waited_s)]
    np.testing.assert_allclose(dated_s, 70.0 + 0.01 * np.arange(2000))


def test_the_clocks_of_a_long_day_may_drift_apart() -> None:
    arrivals = ClockOffset()
    dated_s = [arrivals.measured_s(at_s, at_s * (1.0 + 5e-5)) for at_s in np.arange(0.0, 7200.0, 0.5)]
    assert 7199.5 * (1.0 + 5e-5) - dated_s[-1] < 0.01


def test_a_source_that_starts_anew_is_dated_by_its_new_clock() -> None:
    arrivals = ClockOffset()
    arrivals.measured_s(5000.0, 10.0)
    assert arrivals.measured_s(0.5, 12.0) == 12.0
    assert arrivals.measured_s(0.6, 12.3) == pytest.approx(12.1)


def test_late_packets_and_repeated_frames_say_nothing_new() -> None:
    stream = AltitudeSource("a stream")
    for time_s, altitude_m in ((1.00, 0.10), (1.02, 0.12), (1.01, 0.11), (1.02, 0.12), (1.03, 0.13)):
        put(stream, time_s, altitude_m)
    assert [sample.advances for sample in stream.take()] == [True, True, False, False, True]
    assert stream.take() == []


def test_a_pose_that_comes_back_to_the_last_bit_is_stale_though_its_frames_advance() -> None:
    stream = AltitudeSource("a stream")
    for time_s, altitude_m in ((1.00, 0.10), (1.01, 0.11), (1.02, 0.11), (1.03, 0.11), (1.04, 0.12)):
        put(stream, time_s, altitude_m)
    assert [sample.advances for sample in stream.take()] == [True, True, False, False, True]


def test_a_source_that_was_switched_off_and_on_advances_again() -> None:
    stream = AltitudeSource("a stream")
    put(stream, 900.0, 0.1, arrived_s=5.0)
    put(stream, 0.01, 0.2, arrived_s=25.0)
    assert [(sample.measured_s, sample.advances) for sample in stream.take()] == [(5.0, True), (25.0, True)]


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("altitude_m", [NAN, INF, -INF])
def test_an_altitude_that_is_no_number_is_a_body_that_is_not_seen(altitude_m: float) -> None:
    stream = AltitudeSource("a stream")
    put(stream, 1.00, 0.10)
    put(stream, 1.01, altitude_m)
    assert [sample.tracking_valid for sample in stream.take()] == [True, False]


def test_a_frozen_pose_is_stale_though_some_of_its_numbers_are_missing() -> None:
    stream = AltitudeSource("a stream")
    for time_s in (1.00, 1.01, 1.02):
        stream.put(Pose(time_s, 0.1, (0.1, float("nan")), tracking_valid=True), time_s)
    assert [sample.advances for sample in stream.take()] == [True, False, False]


@pytest.mark.parametrize("time_s", [NAN, INF])
def test_a_time_that_is_not_a_number_is_ignored(time_s: float) -> None:
    stream = AltitudeSource("a stream")
    put(stream, 1.00, 0.10)
    put(stream, time_s, 0.11, arrived_s=1.01)
    put(stream, 1.02, 0.12)
    assert [(sample.measured_s, sample.advances) for sample in stream.take()] == [
        (1.0, True),
        (1.01, False),
        (1.02, True),
    ]
