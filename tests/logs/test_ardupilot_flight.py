"""Flights in ArduCopter's logs: the recorded one, and simulated ones, logged well and badly."""

import io
import math
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.logged_flight import ardupilot_flight
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.errors import InputError, TrajectoryError
from app.core.records.trajectory import Samples
from tests.core.analysis.flights import GUSTY, simulated_flight
from tests.logs.recorded import recorded
from tests.logs.written import (
    ARMED,
    AUTO,
    DISARMED,
    GUIDED,
    LAND,
    LANDED,
    LOITER,
    NEWER_PARAMETERS,
    NOT_LANDED,
    PARAMETERS,
    PSCD,
    RTL,
    STABILIZE,
    VIBRATION_FAILSAFE,
    ardupilot_log,
)


@cache
def gusty() -> LoggedFlight:
    return simulated_flight(GUSTY)


def read(content: bytes) -> LoggedFlight:
    return ardupilot_flight(read_ardupilot(io.BytesIO(content)), "flight.bin")


def loop_of(flight: LoggedFlight) -> ArduPilotLoop:
    assert isinstance(flight.loop, ArduPilotLoop)
    return flight.loop


def refusal(content: bytes) -> tuple[str, str]:
    with pytest.raises(InputError) as refused:
        read(content)
    (problem,) = refused.value.problems
    return problem.field, problem.code


def spans_s(flight: LoggedFlight) -> list[tuple[float, float]]:
    """Begin and end of each segment, s after takeoff."""
    return [(round(float(each.time_s[0]) - 5.0, 1), round(float(each.time_s[-1]) - 5.0, 1)) for each in flight.segments]


def test_the_recorded_flight_is_read_from_takeoff_to_landing() -> None:
    """Airborne at 44.90 s, LAND at 68.68 s; parameters are SITL's, hover throttle that of the log."""
    flight = read(recorded("arducopter_steps.bin"))
    (segment,) = flight.segments
    assert (segment.time_s[0], segment.time_s[-1]) == pytest.approx((46.95, 68.65), abs=0.06)
    assert (loop_of(flight).parameters.hover_throttle, loop_of(flight).parameters.takeoff_throttle) == pytest.approx(
        (0.39, 0.9)
    )
    assert replace(loop_of(flight).parameters, hover_throttle=0.35, takeoff_throttle=0.9) == Parameters()
    assert (loop_of(flight).filter_hz, flight.loop.step_s) == (20.0, 1 / 400)
    assert flight.throttle_mean == pytest.approx(0.363, abs=0.002)


def test_a_simulated_flight_is_read_as_it_was_flown() -> None:
    flight = read(ardupilot_log(gusty()))
    (segment,), (flown,) = flight.segments, gusty().segments
    for name in ("z_m", "v_m_s", "a_m_s2", "z_d_m", "v_d_m_s", "a_d_m_s2", "v_t_m_s", "throttle", "throttle_filtered"):
        assert np.asarray(getattr(segment, name)) == pytest.approx(getattr(flown, name), rel=1e-6, abs=1e-6), name
    assert loop_of(flight).parameters.hover_throttle == pytest.approx(0.35)
    assert replace(loop_of(flight).parameters, hover_throttle=0.35) == Parameters()


def test_parameters_of_release_4_7_are_read_by_their_new_names_and_units() -> None:
    older, newer = (read(ardupilot_log(gusty(), parameters=each)) for each in (PARAMETERS, NEWER_PARAMETERS))
    assert (loop_of(older).names, loop_of(newer).names["PSC_ACCZ_P"]) == ({}, ("PSC_D_ACC_P", 0.1))
    assert loop_of(newer).parameters == loop_of(older).parameters
    assert newer.loop.named({"PSC_ACCZ_P": 0.5}) == {"PSC_D_ACC_P": 0.05}


def test_every_mode_that_holds_altitude_counts_and_landing_does_not() -> None:
    log = ardupilot_log(
        gusty(), modes=((0.0, LOITER), (15.0, GUIDED), (22.0, LAND)), events=((0.0, NOT_LANDED), (60.0, LANDED))
    )
    assert spans_s(read(log)) == [(10.0, 21.9)]


@pytest.mark.parametrize(("mode", "holds"), [(13, True), (21, True), (24, True), (1, False), (8, False), (11, False)])
def test_rarer_modes_hold_altitude_or_not(mode: int, holds: bool) -> None:
    """SPORT, SMART_RTL, ZIGZAG; ACRO, POSITION, DRIFT."""
    log = ardupilot_log(gusty(), modes=((0.0, mode),))
    if holds:
        assert spans_s(read(log)) == [(10.0, 26.9)]
    else:
        assert refusal(log) == ("MODE", "altitude_not_held")


def test_the_seconds_around_takeoff_and_landing_are_left_out() -> None:
    log = ardupilot_log(gusty(), events=((11.0, NOT_LANDED), (20.5, LANDED)))
    assert spans_s(read(log)) == [(13.0, 17.4)]


def test_a_manual_mode_is_refused() -> None:
    assert refusal(ardupilot_log(gusty(), modes=((0.0, STABILIZE),))) == ("MODE", "altitude_not_held")


def test_a_log_that_never_left_the_ground_is_refused() -> None:
    without_thrust = changed(throttle_filtered=0.0 * gusty().segments[0].throttle)
    for log in (
        ardupilot_log(gusty(), events=((0.0, ARMED),)),
        ardupilot_log(standing(), events=()),
        ardupilot_log(without_thrust, events=()),
    ):
        assert refusal(log) == ("EV", "never_flew")


@pytest.mark.parametrize(
    ("events", "flown_s"),
    [
        ((), (10.0, 26.9)),
        (((20.0, LANDED),), (10.0, 16.9)),
        (((20.0, DISARMED),), (10.0, 16.9)),
        (((15.0, NOT_LANDED),), (17.0, 26.9)),
        (((15.0, ARMED), (17.0, NOT_LANDED)), (19.0, 26.9)),
        (((15.0, LANDED), (16.0, NOT_LANDED)), (18.0, 26.9)),
    ],
)
def test_a_log_that_begins_in_the_air_is_read_by_altitude_until_an_event_tells(
    events: tuple[tuple[float, int], ...], flown_s: tuple[float, float]
) -> None:
    assert spans_s(read(ardupilot_log(gusty(), events=events)))[-1] == flown_s


def test_filters_that_leave_nothing_together_tell_the_seconds_that_each_takes() -> None:
    """17 s in the air: 3 s in STABILIZE, leaning in 10 s, and 4 s with a reset of the altitude in the middle."""
    lean = [(0.2 * step, 40.0 if 14.0 < 0.2 * step < 24.0 else 0.0, 0.0) for step in range(200)]
    log = ardupilot_log(moved("z_m", 2.0, 1.0), modes=((0.0, GUIDED), (24.0, STABILIZE)), attitude=lean)
    with pytest.raises(TrajectoryError) as refused:
        read(log)
    (problem,) = refused.value.problems
    assert (problem.field, problem.code) == ("ATT", "leans")
    assert problem.numbers == pytest.approx(
        {
            "flown_s": 16.9,
            "held_s": 14.0,
            "left_out_by_altitude_not_held_s": 2.9,
            "left_out_by_leans_s": 12.0,
            "left_out_by_resets_s": 2.0,
            "needed_s": 4.0,
        },
        abs=0.21,
    )
    assert "left out: 2.9 s (altitude not held), " in problem.reason


def landing(flight: LoggedFlight, *, detected_s: float) -> LoggedFlight:
    """The flight with a descent to the ground at its end, 0.7 m/s, a hard contact, and rest until it is detected."""
    (segment,) = flight.segments
    fall_s, step_s = 5.0 / 0.7, 0.1
    more = np.arange(1, round((fall_s + detected_s + 2.0) / step_s)) * step_s
    falls = more < fall_s
    height = np.maximum(5.0 - 0.7 * more, 0.0)
    tail = {
        "time_s": segment.time_s[-1] + more,
        "z_m": height,
        "z_d_m": 5.0 - 0.7 * more,
        "v_m_s": np.where(falls, -0.7, 0.0),
        "v_d_m_s": np.full_like(more, -0.7),
        "v_t_m_s": np.full_like(more, -0.7),
        "a_m_s2": np.where(falls, 0.0, 9.0 * np.sin(30.0 * more)),
        "a_d_m_s2": np.zeros_like(more),
        "throttle": np.where(falls, 0.39, 0.2),
        "throttle_filtered": np.where(falls, 0.39, 0.2),
        "assumed_hover": np.full_like(more, 0.4),
    }
    joined = {name: np.append(getattr(segment, name), tail[name]) for name in tail}
    return replace(flight, segments=[replace(segment, **joined)])


@pytest.mark.parametrize("mode", [RTL, AUTO, LOITER, GUIDED, LAND])
@pytest.mark.parametrize("detected_s", [0.5, 4.0])
def test_a_landing_is_left_out_in_every_mode(mode: int, detected_s: float) -> None:
    """From 27 s on it descends from 5 m, and touches down at 34.1 s, which is reported late."""
    at_s = 27.0 + 5.0 / 0.7 + detected_s
    log = ardupilot_log(
        landing(gusty(), detected_s=detected_s),
        modes=((0.0, GUIDED), (27.0, mode)),
        events=((0.0, NOT_LANDED), (at_s, LANDED)),
    )
    ((begin_s, end_s),) = spans_s(read(log))
    assert begin_s == 10.0
    assert end_s == pytest.approx(26.9, abs=0.25)


@pytest.mark.parametrize(
    ("parameters", "frame"),
    [
        ({"FRAME_CLASS": 6.0}, "helicopter"),
        ({"FRAME_CLASS": 11.0}, "helicopter"),
        ({"FRAME_CLASS": 13.0}, "helicopter"),
        ({"H_SW_TYPE": 3.0}, "helicopter"),
        ({"Q_ENABLE": 1.0}, "VTOL"),
    ],
)
def test_another_kind_of_vehicle_is_known_by_its_parameters(parameters: dict[str, float], frame: str) -> None:
    with pytest.raises(TrajectoryError) as refused:
        read(ardupilot_log(gusty(), parameters={**PARAMETERS, **parameters}))
    (problem,) = refused.value.problems
    assert (problem.code, [*problem.named]) == ("not_a_copter", [frame])


def test_a_copter_whose_log_could_hold_a_helicopters_messages_is_read() -> None:
    parameters = {**PARAMETERS, "FRAME_CLASS": 1.0, "Q_ENABLE": 0.0}
    assert spans_s(read(ardupilot_log(gusty(), parameters=parameters))) == [(10.0, 26.9)]


def test_a_throttle_hardly_below_zero_is_none() -> None:
    (segment,) = gusty().segments
    throttle = segment.throttle_filtered.copy()
    throttle[90:93] = -4e-7
    (found,) = read(ardupilot_log(changed(throttle_filtered=throttle))).segments
    assert len(found.time_s) == len(segment.time_s)
    assert found.throttle_filtered.min() == 0.0


def test_a_change_of_the_gains_ends_a_part_and_the_one_with_the_steps_counts() -> None:
    """The step up is at 14 s, the one down at 20.5 s; other gains from 12 s on are those of the flight."""
    flight = read(ardupilot_log(gusty(), changes=((12.0, "PSC_ACCZ_P", 0.8),)))
    assert loop_of(flight).parameters.acceleration_p == pytest.approx(0.8)
    assert spans_s(flight) == [(12.0, 26.9)]


def test_learned_hover_throttle_does_not_end_a_part() -> None:
    flight = read(ardupilot_log(gusty(), changes=((15.0, "MOT_THST_HOVER", 0.36),)))
    assert spans_s(flight) == [(10.0, 26.9)]
    assert loop_of(flight).parameters.hover_throttle == pytest.approx(0.35)


def test_parts_with_the_same_parameters_count_together() -> None:
    """Back in STABILIZE for a second: two parts of the same flight, in order."""
    flight = read(ardupilot_log(gusty(), modes=((0.0, GUIDED), (17.0, STABILIZE), (18.0, GUIDED))))
    assert spans_s(flight) == [(10.0, 16.9), (18.0, 26.9)]


def changed(**signals: Samples) -> LoggedFlight:
    """The flight with other signals."""
    (segment,) = gusty().segments
    return replace(gusty(), segments=[replace(segment, **signals)])


def test_of_a_long_flight_the_two_minutes_with_most_manoeuvres_are_read() -> None:
    """140 s of hover, then the steps: 17 s at the end."""
    (segment,) = gusty().segments
    hover = {name: np.tile(getattr(segment, name)[20:40], 70) for name in type(segment).__slots__}
    joined = {name: np.append(hover[name], getattr(segment, name)) for name in hover}
    time_s = 0.1 * np.arange(len(joined["time_s"]))
    log = ardupilot_log(replace(gusty(), segments=[replace(segment, **{**joined, "time_s": time_s})]))
    ((begin_s, end_s),) = spans_s(read(log))
    assert end_s - begin_s <= 120.0
    assert (begin_s < 10.0 + 140.0 + 4.0, end_s > 10.0 + 140.0 + 13.0) == (True, True)


def test_a_hundred_rows_a_second_are_thinned_to_ten() -> None:
    (logged,) = gusty().segments
    time_s = np.arange(0.0, logged.duration_s, 0.01)
    names = [name for name in type(logged).__slots__ if name != "time_s"]
    often = {name: np.interp(time_s, logged.time_s, getattr(logged, name)) for name in names}
    (segment,) = read(ardupilot_log(changed(time_s=time_s, **often))).segments
    assert np.diff(segment.time_s)[1:] == pytest.approx(0.1, abs=0.011)


def test_an_older_release_without_the_shaped_altitude_is_read_by_its_target() -> None:
    older, newer = (read(ardupilot_log(gusty(), has_shaped_altitude=each)) for each in (False, True))
    assert older.segments[0].z_d_m == pytest.approx(newer.segments[0].z_d_m)


def test_release_4_1_logs_the_same_loop_positive_up() -> None:
    older, newer = (read(ardupilot_log(gusty(), is_upward=each)) for each in (True, False))
    for each in fields(Segment):
        assert getattr(older.segments[0], each.name) == pytest.approx(getattr(newer.segments[0], each.name)), each.name
    assert refusal(ardupilot_log(gusty(), is_upward=True).replace(b",TVZ", b",XVZ")) == ("PSCZ.TVZ", "column_missing")


def test_a_release_that_logs_the_loop_by_another_name_or_without_a_column_is_named() -> None:
    log = ardupilot_log(gusty())
    assert refusal(log.replace(b",TVD", b",XVD")) == ("PSCD.TVD", "column_missing")
    assert refusal(log.replace(b",DPD,TPD", b",XPD,YPD"))[0] == "PSCD.DPD"


def standing() -> LoggedFlight:
    """A vehicle on the ground with its motors turning, whose altitude drifts by decimetres."""
    return changed(**{each: 0.05 * getattr(gusty().segments[0], each) for each in ("z_m", "z_d_m")})


def moved(name: str, at_s: float, by: float, *, rows: int | None = None) -> LoggedFlight:
    """The flight with a signal moved from that time on, or for some rows."""
    (segment,) = gusty().segments
    values = getattr(segment, name).copy()
    first = round(10.0 * at_s)
    values[first : None if rows is None else first + rows] += by
    return changed(**{name: values})


@pytest.mark.parametrize(("name", "by"), [("z_m", 0.5), ("z_m", -3.0), ("z_d_m", 0.5)])
def test_a_reset_of_the_estimator_or_the_reference_ends_a_part(name: str, by: float) -> None:
    assert spans_s(read(ardupilot_log(moved(name, 9.0, by)))) == [(10.0, 18.9), (19.0, 26.9)]


def test_a_row_that_cannot_be_is_left_out() -> None:
    """Dataflash has no checksum: one altitude of 1000 km, one climb rate of 3, one acceleration of 60 m/s²."""
    for name, by in (("z_m", 1e6), ("v_m_s", 3.0), ("a_m_s2", 60.0), ("throttle_filtered", 40.0)):
        assert spans_s(read(ardupilot_log(moved(name, 9.0, by, rows=1)))) == [(10.0, 18.9), (19.1, 26.9)], name


def test_rows_without_a_throttle_beside_them_are_left_out() -> None:
    assert spans_s(read(ardupilot_log(gusty(), without_throttle_s=(18.05, 19.05)))) == [(10.0, 18.0), (19.2, 26.9)]


def test_rows_that_came_twice_count_once() -> None:
    (segment,) = gusty().segments
    twice = {name: np.repeat(getattr(segment, name), 2) for name in type(segment).__slots__}
    flight = read(ardupilot_log(replace(gusty(), segments=[replace(segment, **twice)])))
    assert spans_s(flight) == [(10.0, 26.9)]


def test_after_a_restart_of_the_clock_the_flights_of_both_boots_count() -> None:
    """Two boots in one file, the first with 8 s more of it, the second 20 s after its end."""
    first, second = ardupilot_log(gusty(), begin_s=18.0), ardupilot_log(gusty())
    alone = spans_s(read(first)) + spans_s(read(second))
    found = spans_s(read(first + second))
    assert found[0] == alone[0]
    assert [end - begin for begin, end in found] == pytest.approx([end - begin for begin, end in alone], abs=0.11)
    assert found[1][0] > found[0][1] + 20.0


def test_a_flight_before_a_restart_on_the_bench_counts() -> None:
    flown = ardupilot_log(gusty())
    for bench in (
        ardupilot_log(gusty(), events=((0.0, ARMED),)),
        ardupilot_log(standing(), events=()),
        ardupilot_log(gusty(), modes=((0.0, STABILIZE),)),
        ardupilot_log(gusty(), modes=(), events=()),
    ):
        assert spans_s(read(flown + bench)) == spans_s(read(flown))


def test_a_boot_on_the_bench_with_a_later_clock_than_the_flight_s_is_not_in_the_air() -> None:
    """Its log begins a while after it started, and the flight before it ended without a landing."""
    flown = ardupilot_log(gusty())
    assert spans_s(read(flown + ardupilot_log(standing(), begin_s=300.0, events=()))) == spans_s(read(flown))
    assert spans_s(read(flown + ardupilot_log(gusty(), begin_s=300.0, events=((290.0, ARMED),)))) == spans_s(
        read(flown)
    )


def test_a_restart_in_the_air_is_flown_on_from() -> None:
    found = spans_s(read(ardupilot_log(gusty()) + ardupilot_log(gusty(), events=())))
    assert [round(end_s - begin_s, 1) for begin_s, end_s in found] == [16.9, 16.8]


def test_a_failsafe_ends_with_a_restart() -> None:
    vibrating = ardupilot_log(gusty(), errors=((12.0, VIBRATION_FAILSAFE, 1),))
    assert len(spans_s(read(vibrating + ardupilot_log(gusty())))) == 1


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_a_ring_whose_first_half_is_newer_is_read_as_the_flight(share: float) -> None:
    whole = ardupilot_log(gusty())
    cut = round(share * len(whole))
    (whole_s,), found = spans_s(read(whole)), spans_s(read(whole[cut:] + whole[:cut]))
    assert (found[0][0], found[-1][1]) == whole_s


def test_what_was_damaged_is_said() -> None:
    whole = ardupilot_log(gusty())
    assert read_ardupilot(io.BytesIO(whole)).notes == []
    damaged = whole[:8000] + bytes(300) + whole[8200:]
    assert read_ardupilot(io.BytesIO(damaged)).notes == [
        "damaged and left out: 357 bytes, and 0 rows with an impossible time"
    ]


def test_a_row_with_a_damaged_time_is_left_out() -> None:
    content = ardupilot_log(gusty())
    damaged = bytearray(content)
    damaged[content.index(bytes([0xA3, 0x95, PSCD]), len(content) // 2) + 8] ^= 0x10
    assert spans_s(read(bytes(damaged))) == spans_s(read(content))


def test_a_leaning_vehicle_carries_by_the_cosine_of_its_throttle() -> None:
    level = read(ardupilot_log(gusty())).segments[0]
    lean = [(0.2 * step, 12.0, 16.0) for step in range(200)]
    leaning = read(ardupilot_log(gusty(), attitude=lean)).segments[0]
    share = math.cos(math.radians(12.0)) * math.cos(math.radians(16.0))
    assert leaning.throttle_filtered == pytest.approx(share * level.throttle_filtered)
    steep = [(0.2 * step, 40.0 if 10.0 < 0.2 * step < 14.0 else 0.0, 0.0) for step in range(200)]
    assert spans_s(read(ardupilot_log(gusty(), attitude=steep))) == [(13.9, 26.9)]
    assert refusal(ardupilot_log(gusty(), attitude=[(at_s, 40.0, 0.0) for at_s, *_ in lean]))[0] == "ATT"


def test_rows_while_vibration_is_compensated_are_left_out() -> None:
    log = ardupilot_log(gusty(), errors=((12.0, VIBRATION_FAILSAFE, 1), (18.0, VIBRATION_FAILSAFE, 0), (20.0, 2, 1)))
    assert spans_s(read(log)) == [(18.0, 26.9)]
    assert refusal(ardupilot_log(gusty(), errors=((0.0, VIBRATION_FAILSAFE, 1),)))[0] == "ERR"


def test_another_thrust_curve_ends_a_part() -> None:
    flight = read(ardupilot_log(gusty(), changes=((12.0, "MOT_THST_EXPO", 0.2),)))
    assert spans_s(flight) == [(12.0, 26.9)]


@pytest.mark.parametrize(
    ("parameters", "code"),
    [
        ({"LOG_BITMASK": 176126.0}, "message_missing"),
        ({}, "message_missing"),
        ({"LOG_BITMASK": 2.0}, "log_bit_unset"),
    ],
)
@pytest.mark.parametrize("message", [b"PSCD", b"CTUN"])
def test_a_bit_is_to_be_set_only_if_it_is_not(message: bytes, parameters: dict[str, float], code: str) -> None:
    content = ardupilot_log(gusty(), parameters={**PARAMETERS, **parameters})
    assert refusal(content.replace(message, b"X" + message[1:])) == (message.decode(), code)


def test_a_message_that_a_release_never_logs_is_not_asked_for() -> None:
    until_4_0 = {name: value for name, value in PARAMETERS.items() if name != "PSC_VELZ_I"}
    content = ardupilot_log(gusty(), parameters={**until_4_0, "LOG_BITMASK": 2.0})
    assert refusal(content.replace(b"PSCD", b"XSCD")) == ("CTUN.Alt", "column_missing")


def test_a_log_without_its_modes_is_refused_as_such() -> None:
    assert refusal(ardupilot_log(gusty(), modes=())) == ("MODE", "message_missing")


@pytest.mark.parametrize(
    ("gain", "newer"),
    [
        ("PSC_POSZ_P", "PSC_D_POS_P"),
        ("PSC_VELZ_P", "PSC_D_VEL_P"),
        ("PSC_ACCZ_P", "PSC_D_ACC_P"),
        ("PSC_ACCZ_I", "PSC_D_ACC_I"),
    ],
)
def test_a_log_without_a_gain_or_with_none_of_it_is_refused(gain: str, newer: str) -> None:
    without = {name: value for name, value in PARAMETERS.items() if name != gain}
    with pytest.raises(TrajectoryError, match=newer):
        read(ardupilot_log(gusty(), parameters=without))
    assert refusal(ardupilot_log(gusty(), parameters=without)) == (gain, "parameter_missing")
    none = ardupilot_log(gusty(), parameters={**PARAMETERS, gain: 0.0})
    assert refusal(none) == (gain, "parameter_not_positive")


def test_a_log_without_parameters_is_refused() -> None:
    assert refusal(ardupilot_log(gusty()).replace(b"PARM", b"XARM"))[0] == "PSC_POSZ_P"


def test_a_limit_that_the_replica_lacks_is_named() -> None:
    with pytest.raises(InputError) as refused:
        read(ardupilot_log(gusty(), parameters={**PARAMETERS, "PSC_ACCZ_SMAX": 5.0}))
    assert [problem.field for problem in refused.value.problems] == ["PSC_ACCZ_SMAX"]


def test_a_loop_rate_that_cannot_be_is_refused() -> None:
    assert refusal(ardupilot_log(gusty(), parameters={**PARAMETERS, "SCHED_LOOP_RATE": 1e9})) == (
        "SCHED_LOOP_RATE",
        "parameter_out_of_range",
    )


def test_rows_that_are_rare_or_not_numbers_are_refused() -> None:
    assert refusal(ardupilot_log(gusty(), rows=slice(0, None, 4))) == ("PSCD", "gaps")
    flight = simulated_flight(GUSTY)
    flight.segments[0].v_m_s[:] = np.nan
    assert refusal(ardupilot_log(flight)) == ("PSCD", "not_numbers")


@pytest.mark.parametrize("share", [0.2, 0.5, 0.7])
def test_a_log_that_was_cut_off_is_read_as_far_as_it_goes_or_refused(share: float) -> None:
    whole = ardupilot_log(gusty())
    content = whole[: round(share * len(whole))]
    if share < 0.5:
        assert refusal(content) == ("file", "too_short")
    else:
        assert spans_s(read(content))[0][0] == 10.0
