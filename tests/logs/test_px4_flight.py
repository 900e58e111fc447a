"""Flights in PX4's logs: the recorded one, and simulated ones, logged well and badly."""

import io
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.autopilots.frames import frame_of
from app.autopilots.px4.experiments import Px4Loop
from app.autopilots.px4.log import read_px4
from app.autopilots.px4.logged_flight import px4_flight
from app.autopilots.px4.replica.parameters import Parameters
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.errors import InputError, TrajectoryError
from tests.core.analysis.px4_flights import simulated_px4
from tests.logs.recorded import recorded
from tests.logs.written_px4 import FLIGHT as IN_FLIGHT
from tests.logs.written_px4 import HOLD, LAND, MISSION, PARAMETERS, POSITION, RAMP_UP, READY, RETURN, TAKEOFF, px4_log


@cache
def flown() -> LoggedFlight:
    return simulated_px4()


@cache
def whole() -> bytes:
    """Its log."""
    return px4_log(flown())


def logged() -> Segment:
    """The flight's one segment."""
    (segment,) = flown().segments
    return segment


def read(content: bytes) -> LoggedFlight:
    return px4_flight(read_px4(io.BytesIO(content)), "flight.ulg")


def loop_of(flight: LoggedFlight) -> Px4Loop:
    assert isinstance(flight.loop, Px4Loop)
    return flight.loop


def spans_s(flight: LoggedFlight) -> list[tuple[float, float]]:
    """Begin and end of each segment, s after the beginning of the log."""
    return [
        (round(float(each.time_s[0]) - 20.0, 1), round(float(each.time_s[-1]) - 20.0, 1)) for each in flight.segments
    ]


def refusal(content: bytes) -> tuple[str, str]:
    with pytest.raises(TrajectoryError) as refused:
        read(content)
    (problem,) = refused.value.problems
    assert "SDLOG_PROFILE" in refused.value.hint
    return problem.field, problem.code


def without_parameter(name: str) -> dict[str, float]:
    return {each: value for each, value in PARAMETERS.items() if each != name}


def test_a_simulated_flight_is_read_as_it_was_flown() -> None:
    """Climb rate and acceleration fed forward are logged in every second row: to 0.03 m/s and 0.3 m/s²."""
    flight = read(px4_log(flown()))
    (segment,) = flight.segments
    close = {"v_d_m_s": 0.03, "a_d_m_s2": 0.3}
    for name in set(Segment.__slots__) - {"time_s"}:
        expected = pytest.approx(getattr(logged(), name), abs=close.get(name, 1e-5))
        assert np.asarray(getattr(segment, name)) == expected, name
    loop = loop_of(flight)
    assert replace(loop.parameters, hover_thrust=0.5) == Parameters()
    assert loop.assumed_hover_throttle == pytest.approx(0.35)
    assert (loop.step_s, loop.row_s, loop.descent_m_s) == pytest.approx((0.008, 0.096, 1.8))


def test_steps_of_offboard_control_have_no_rates() -> None:
    (segment,) = read(px4_log(simulated_px4(manoeuvre="offboard"), feed_forward=False)).segments
    assert np.ptp(segment.z_d_m) == pytest.approx(1.0)
    assert not segment.v_d_m_s.any()
    assert not segment.a_d_m_s2.any()


def test_of_the_recorded_takeoff_nothing_is_left() -> None:
    assert refusal(recorded("px4_takeoff.ulg")) == ("vehicle_status", "only_takeoffs_or_landings")


@pytest.mark.parametrize(
    ("options", "field", "code"),
    [
        ({"without": ["vehicle_local_position"]}, "vehicle_local_position", "message_missing"),
        ({"without": ["trajectory_setpoint"]}, "trajectory_setpoint", "message_missing"),
        ({"without": ["takeoff_status", "vehicle_land_detected"]}, "takeoff_status", "message_missing"),
        ({"without": ["vehicle_status"]}, "vehicle_status", "message_missing"),
        (
            {"renamed": ("float[3] thrust;", "float[3] xhrust;")},
            "vehicle_local_position_setpoint.thrust[2]",
            "column_missing",
        ),
        ({"takeoff": ((0.0, READY), (1.0, RAMP_UP))}, "takeoff_status", "never_flew"),
        ({"without": ["takeoff_status"], "landed": ((0.0, True),)}, "takeoff_status", "never_flew"),
        ({"landed": ((0.0, True),)}, "takeoff_status", "never_flew"),
        ({"modes": ((0.0, TAKEOFF), (8.0, LAND))}, "vehicle_status", "only_takeoffs_or_landings"),
        (
            {"has_altitude": False, "modes": ((0.0, POSITION),)},
            "vehicle_local_position_setpoint.z",
            "manual_altitude",
        ),
        ({"tilt": 0.7}, "vehicle_local_position_setpoint.thrust", "leans"),
        (
            {"modes": ((0.0, TAKEOFF), (3.0, HOLD), (5.0, LAND))},
            "vehicle_status",
            "only_takeoffs_or_landings",
        ),
        ({"parameters": without_parameter("MPC_Z_VEL_D_ACC")}, "MPC_Z_VEL_D_ACC", "parameter_missing"),
        ({"parameters": {**PARAMETERS, "MPC_Z_P": 0.0}}, "MPC_Z_P", "parameter_not_positive"),
    ],
)  # fmt: skip
def test_a_log_that_cannot_be_used_is_refused_by_what_is_missing(
    options: dict[str, Any], field: str, code: str
) -> None:
    assert refusal(px4_log(flown(), **options)) == (field, code)


def test_a_log_with_a_single_row_is_refused() -> None:
    first = replace(logged(), **{name: getattr(logged(), name)[:1] for name in Segment.__slots__})
    assert refusal(px4_log(replace(flown(), segments=[first])))[1] in {"never_flew", "manual_altitude"}


def test_thrust_without_numbers_is_refused() -> None:
    unknown = replace(logged(), throttle=np.full_like(logged().throttle, np.nan))
    assert refusal(px4_log(replace(flown(), segments=[unknown]))) == (
        "vehicle_local_position_setpoint",
        "not_numbers",
    )


def test_the_notch_filter_of_the_velocity_is_refused_by_its_parameter() -> None:
    with pytest.raises(InputError, match="MPC_VEL_NF_FRQ: must be 0"):
        read(px4_log(flown(), parameters={**PARAMETERS, "MPC_VEL_NF_FRQ": 8.0}))


def test_takeoff_and_landing_are_left_out() -> None:
    log = px4_log(flown(), modes=((0.0, TAKEOFF), (3.0, HOLD), (9.0, MISSION), (20.0, LAND)))
    assert spans_s(read(log)) == [(3.1, 20.0)]


@pytest.mark.parametrize("mode", [RETURN, MISSION, HOLD, LAND])
@pytest.mark.parametrize("detected_s", [0.5, 4.0])
def test_a_landing_is_left_out_in_every_mode(mode: int, detected_s: float) -> None:
    """From 24 s on it descends from its last altitude, and the land detector is late."""
    segment = logged()
    fall_s = float(segment.z_m[-1]) / 0.7
    more = np.arange(0.096, fall_s + detected_s + 2.0, 0.096)
    falls, down_m = more < fall_s, float(segment.z_m[-1]) - 0.7 * more
    tail = {
        "time_s": segment.time_s[-1] + more,
        "z_m": np.maximum(down_m, 0.0),
        "z_d_m": down_m,
        "throttle": np.where(falls, 0.38, 0.1),
        "throttle_filtered": np.where(falls, 0.38, 0.1),
        "assumed_hover": np.full_like(more, 0.4),
        "a_m_s2": np.zeros_like(more),
        "a_d_m_s2": np.zeros_like(more),
        "v_m_s": np.where(falls, -0.7, 0.0),
        "v_d_m_s": np.full_like(more, -0.7),
        "v_t_m_s": np.full_like(more, -0.7),
    }
    joined = replace(segment, **{name: np.append(getattr(segment, name), tail[name]) for name in tail})
    log = px4_log(
        replace(flown(), segments=[joined]),
        modes=((0.0, HOLD), (24.0, mode)),
        landed=((0.0, False), (24.0 + fall_s + detected_s, True)),
    )
    ((begin_s, end_s),) = spans_s(read(log))
    assert begin_s == 0.0
    assert end_s == pytest.approx(23.9, abs=0.3)


@pytest.mark.parametrize(
    ("options", "frame"),
    [
        ({"kind": 2}, "plane"),
        ({"kind": 3}, "rover"),
        ({"parameters": {**PARAMETERS, "CA_AIRFRAME": 2}}, "VTOL"),
        ({"parameters": {**PARAMETERS, "CA_AIRFRAME": 10}}, "helicopter"),
        ({"parameters": {**PARAMETERS, "MAV_TYPE": 22}}, "VTOL"),
        ({"parameters": {**PARAMETERS, "SYS_AUTOSTART": 13000}}, "VTOL"),
    ],
)
def test_another_kind_of_vehicle_is_refused(options: dict[str, Any], frame: str) -> None:
    """Most report rotors in their status."""
    with pytest.raises(TrajectoryError) as refused:
        read(px4_log(flown(), **options))
    (problem,) = refused.value.problems
    assert (problem.code, [*problem.named]) == ("not_a_copter", [frame])
    assert frame_of(read_px4(io.BytesIO(px4_log(flown(), **options)))) == frame


def test_a_copter_by_its_airframe_is_read() -> None:
    parameters = {**PARAMETERS, "CA_AIRFRAME": 0, "MAV_TYPE": 2, "SYS_AUTOSTART": 4001}
    assert spans_s(read(px4_log(flown(), parameters=parameters))) == spans_s(read(whole()))


def test_a_thrust_hardly_below_zero_is_none() -> None:
    thrust = logged().throttle.copy()
    thrust[100:103] = -4e-7
    flight = read(px4_log(replace(flown(), segments=[replace(logged(), throttle=thrust)])))
    assert spans_s(flight) == spans_s(read(whole()))
    assert flight.segments[0].throttle.min() == 0.0


def test_the_ramp_of_a_takeoff_and_the_ground_are_left_out() -> None:
    log = px4_log(flown(), takeoff=((0.0, RAMP_UP), (2.0, IN_FLIGHT)), landed=((0.0, False), (40.0, True)))
    assert spans_s(read(log)) == [(2.0, 23.9)]


def test_without_its_state_a_takeoff_lasts_as_long_as_the_ramp_after_the_lift_off() -> None:
    log = px4_log(flown(), without=["takeoff_status"], landed=((0.0, True), (1.0, False)))
    assert spans_s(read(log)) == [(4.0, 23.9)]


def test_a_change_of_the_gains_ends_a_part_and_the_one_with_the_steps_counts() -> None:
    flight = read(px4_log(flown(), changes=((8.0, "MPC_Z_VEL_P_ACC", 5.0),)))
    assert loop_of(flight).parameters.velocity_p_1_s == pytest.approx(5.0)
    assert spans_s(flight) == [(8.0, 23.9)]


def test_a_reset_of_the_estimator_ends_a_part() -> None:
    flight = read(px4_log(flown(), resets=((0.0, 3), (12.0, 4))))
    assert spans_s(flight) == [(0.0, 11.9), (12.0, 23.9)]


@pytest.mark.parametrize("parameters", [{"EKF2_PREDICT_US": 10_000, "IMU_INTEG_RATE": 200}, {}])
def test_the_loop_runs_in_whole_intervals_of_the_imu(parameters: dict[str, float]) -> None:
    others = without_parameter("EKF2_PREDICT_US")
    del others["IMU_INTEG_RATE"]
    assert read(px4_log(flown(), parameters={**others, **parameters})).loop.step_s == pytest.approx(0.01)


def test_where_every_position_was_logged_their_interval_is_the_step() -> None:
    """Rows of 10 ms, of which the analysis takes ten a second."""
    time_s = np.arange(0.0, logged().duration_s, 0.01)
    names = [name for name in Segment.__slots__ if name != "time_s"]
    often = Segment(
        time_s=time_s, **{name: np.interp(time_s, logged().time_s, getattr(logged(), name)) for name in names}
    )
    flight = read(px4_log(replace(flown(), segments=[often])))
    assert flight.loop.step_s == pytest.approx(0.01)
    assert loop_of(flight).row_s == pytest.approx(0.1, abs=0.015)


def test_thrust_that_was_logged_more_often_is_used_between_the_rows() -> None:
    (finer,) = read(px4_log(flown(), finer_thrust=lambda time_s: 0.3 + 0.0 * time_s)).segments
    middle_s = 0.5 * (finer.time_s[100] + finer.time_s[101])
    assert finer.motor_throttle(np.array([middle_s]))[0] == pytest.approx(0.3, abs=1e-6)
    (rows,) = read(px4_log(flown())).segments
    assert rows.motor_throttle(rows.time_s) == pytest.approx(rows.throttle_filtered)


def test_a_single_set_point_gives_no_rates() -> None:
    assert refusal(px4_log(flown(), set_points=1))[0] == "vehicle_local_position_setpoint.z"


def test_the_limits_are_the_parameters_where_they_were_not_logged() -> None:
    assert loop_of(read(px4_log(flown(), without=["vehicle_constraints"]))).descent_m_s == pytest.approx(1.5)


def test_a_file_that_was_cut_off_says_so_where_it_does_not_suffice() -> None:
    content = px4_log(flown())
    with pytest.raises(TrajectoryError, match="; the file ends in the middle of a message"):
        read(content[: len(content) // 8 - 7])


@given(st.data())
@settings(max_examples=25, deadline=None)
def test_a_damaged_log_is_read_or_refused(data: st.DataObject) -> None:
    log = whole()
    length = data.draw(st.integers(16, len(log)))
    content = bytearray(log[:length])
    for place, value in data.draw(st.lists(st.tuples(st.integers(0, length - 1), st.integers(0, 255)), max_size=20)):
        content[place] = value
    with suppress(InputError):
        for segment in read(bytes(content)).segments:
            assert (np.diff(segment.time_s) > 0.0).all()
            assert np.isfinite(segment.z_m + segment.z_d_m + segment.throttle + segment.assumed_hover).all()
