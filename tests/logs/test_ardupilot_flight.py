"""Flights in ArduCopter's logs: the recorded one, and simulated ones, logged well and badly."""

import io
from dataclasses import replace

import numpy as np
import pytest

from app.core.analysis.flight import LoggedFlight
from app.core.control.ardupilot_parameters import Parameters
from app.core.errors import InputError, TrajectoryError
from app.logs.ardupilot_flight import read_ardupilot_flight
from tests.core.analysis.flights import GUSTY, simulated_flight
from tests.logs.recorded import recorded
from tests.logs.written import GUIDED, LAND, LANDED, LOITER, NEWER_PARAMETERS, NOT_LANDED, PARAMETERS, STABILIZE, ardupilot_log

FLIGHT = simulated_flight(GUSTY)


def read(content: bytes) -> LoggedFlight:
    return read_ardupilot_flight(io.BytesIO(content), name="flight.bin")


def refusal(content: bytes) -> tuple[str, str]:
    with pytest.raises(TrajectoryError) as refused:
        read(content)
    (problem,) = refused.value.problems
    return problem.field, problem.reason


def spans_s(flight: LoggedFlight) -> list[tuple[float, float]]:
    """Begin and end of each segment, s after takeoff."""
    return [(round(float(each.time_s[0]) - 5.0, 1), round(float(each.time_s[-1]) - 5.0, 1)) for each in flight.segments]


def test_the_recorded_flight_is_read_from_takeoff_to_landing() -> None:
    """Airborne at 44.90 s, LAND at 68.68 s; parameters are SITL's, hover throttle that of the log."""
    flight = read(recorded("arducopter_steps.bin"))
    (segment,) = flight.segments
    assert (segment.time_s[0], segment.time_s[-1]) == pytest.approx((46.95, 68.65), abs=0.06)
    assert (flight.parameters.hover_throttle, flight.parameters.takeoff_throttle) == pytest.approx((0.39, 0.9))
    assert replace(flight.parameters, hover_throttle=0.35, takeoff_throttle=0.9) == Parameters()
    assert (flight.filter_hz, flight.step_s) == (20.0, 1 / 400)
    assert flight.throttle_mean == pytest.approx(0.363, abs=0.002)


def test_a_simulated_flight_is_read_as_it_was_flown() -> None:
    flight = read(ardupilot_log(FLIGHT))
    (segment,), (flown,) = flight.segments, FLIGHT.segments
    for name in ("z_m", "v_m_s", "a_m_s2", "z_d_m", "v_d_m_s", "a_d_m_s2", "v_t_m_s", "throttle", "throttle_filtered"):
        assert np.asarray(getattr(segment, name)) == pytest.approx(getattr(flown, name), rel=1e-6, abs=1e-6), name
    assert flight.parameters.hover_throttle == pytest.approx(0.35)
    assert replace(flight.parameters, hover_throttle=0.35) == Parameters()


def test_parameters_of_release_4_7_are_read_by_their_new_names_and_units() -> None:
    older, newer = (read(ardupilot_log(FLIGHT, parameters=each)) for each in (PARAMETERS, NEWER_PARAMETERS))
    assert (older.has_newer_names, newer.has_newer_names) == (False, True)
    assert newer.parameters == older.parameters
    assert newer.named({"PSC_ACCZ_P": 0.5}) == {"PSC_D_ACC_P": 0.05}


def test_every_mode_that_holds_altitude_counts_and_landing_does_not() -> None:
    log = ardupilot_log(
        FLIGHT, modes=((0.0, LOITER), (15.0, GUIDED), (22.0, LAND)), events=((0.0, NOT_LANDED), (26.0, LANDED))
    )
    assert spans_s(read(log)) == [(10.0, 21.9)]


def test_the_seconds_around_takeoff_and_landing_are_left_out() -> None:
    log = ardupilot_log(FLIGHT, events=((11.0, NOT_LANDED), (26.0, LANDED)))
    assert spans_s(read(log)) == [(13.0, 22.9)]


def test_a_manual_mode_is_refused() -> None:
    assert refusal(ardupilot_log(FLIGHT, modes=((0.0, STABILIZE),))) == (
        "PSCD",
        "has no 4 s in flight in a mode that holds altitude",
    )


def test_a_log_that_never_left_the_ground_is_refused() -> None:
    assert refusal(ardupilot_log(FLIGHT, events=()))[0] == "PSCD"


def test_a_change_of_the_gains_ends_a_part_and_the_one_with_the_steps_counts() -> None:
    """The step up is at 14 s, the one down at 20.5 s; other gains from 12 s on are those of the flight."""
    flight = read(ardupilot_log(FLIGHT, changes=((12.0, "PSC_ACCZ_P", 0.8),)))
    assert flight.parameters.acceleration_p == pytest.approx(0.8)
    assert spans_s(flight) == [(12.0, 26.9)]


def test_learned_hover_throttle_does_not_end_a_part() -> None:
    flight = read(ardupilot_log(FLIGHT, changes=((15.0, "MOT_THST_HOVER", 0.36),)))
    assert spans_s(flight) == [(10.0, 26.9)]
    assert flight.parameters.hover_throttle == pytest.approx(0.35)


def test_parts_with_the_same_parameters_count_together() -> None:
    """Back in STABILIZE for a second: two parts of the same flight, in order."""
    flight = read(ardupilot_log(FLIGHT, modes=((0.0, GUIDED), (17.0, STABILIZE), (18.0, GUIDED))))
    assert spans_s(flight) == [(10.0, 16.9), (18.0, 26.9)]


def test_a_long_flight_is_cut() -> None:
    """Of ten repetitions, 170 s, the 120 s from the beginning of the part."""
    (segment,) = FLIGHT.segments
    repeated = {name: np.tile(getattr(segment, name), 10) for name in type(segment).__slots__}
    long = replace(segment, **{**repeated, "time_s": 0.1 * np.arange(10 * len(segment.time_s))})
    log = ardupilot_log(replace(FLIGHT, segments=[long]))
    assert spans_s(read(log)) == [(10.0, 130.0)]


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (b"PSCD", "is missing: add NTUN to LOG_BITMASK, and fly again"),
        (b"CTUN", "is missing: add CTUN to LOG_BITMASK, and fly again"),
    ],
)
def test_a_missing_message_is_named_with_what_to_switch_on(message: bytes, reason: str) -> None:
    content = ardupilot_log(FLIGHT).replace(message, b"X" + message[1:])
    assert refusal(content) == (message.decode(), reason)


def test_a_log_without_the_gains_is_refused_by_both_of_their_names() -> None:
    without = {name: value for name, value in PARAMETERS.items() if name != "PSC_POSZ_P"}
    refused = refusal(ardupilot_log(FLIGHT, parameters=without))
    assert refused == ("PSC_POSZ_P", "is missing, and PSC_D_POS_P of release 4.7 too")
    assert refusal(ardupilot_log(FLIGHT).replace(b"PARM", b"XARM"))[0] == "PSC_POSZ_P"


def test_a_limit_that_the_replica_lacks_is_named() -> None:
    with pytest.raises(InputError) as refused:
        read(ardupilot_log(FLIGHT, parameters={**PARAMETERS, "PSC_ACCZ_SMAX": 5.0}))
    assert [problem.field for problem in refused.value.problems] == ["PSC_ACCZ_SMAX"]


def test_rates_and_filters_that_cannot_be_are_the_defaults() -> None:
    flight = read(ardupilot_log(FLIGHT, parameters={**PARAMETERS, "SCHED_LOOP_RATE": 1e9, "INS_ACCEL_FILTER": 0.0}))
    assert (flight.filter_hz, flight.step_s) == (20.0, 1 / 400)


def test_rows_that_are_rare_or_not_numbers_are_refused() -> None:
    assert refusal(ardupilot_log(FLIGHT, rows=slice(0, None, 4)))[0] == "PSCD"
    flight = simulated_flight(GUSTY)
    flight.segments[0].v_m_s[:] = np.nan
    assert refusal(ardupilot_log(flight))[0] == "PSCD"


@pytest.mark.parametrize("share", [0.2, 0.5, 0.7])
def test_a_log_that_was_cut_off_is_read_as_far_as_it_goes_or_refused(share: float) -> None:
    whole = ardupilot_log(FLIGHT)
    content = whole[: round(share * len(whole))]
    if share < 0.5:
        assert refusal(content)[0] == "PSCD"
    else:
        assert spans_s(read(content))[0][0] == 10.0


@pytest.mark.parametrize("name", ["px4_takeoff.ulg", "paparazzi_283_13_82.tlog"])
def test_another_kind_of_log_is_named(name: str) -> None:
    field, reason = refusal(recorded(name))
    assert field == "file"
    assert "only ArduPilot's .bin logs can be analysed" in reason
    assert {"px4_takeoff.ulg": "PX4's log", "paparazzi_283_13_82.tlog": "MAVLink telemetry log"}[name] in reason


def test_a_file_that_is_no_log_is_refused() -> None:
    assert refusal(b"")[1].startswith("is empty")
    assert refusal(b"hello\n" * 100)[1].startswith("is not a log")
