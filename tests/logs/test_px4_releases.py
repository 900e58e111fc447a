"""PX4's logs as its releases wrote them: what each is answered, in the names and units of its parameters, and why not
more.

The simulated vehicle is known; the recorded one, of release 1.17, is answered as from its own log.
"""

import io
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.autopilots.described import loop_of, signals_of
from app.autopilots.px4.experiments import Px4Loop, px4_loop
from app.autopilots.px4.log import read_px4
from app.autopilots.px4.logged_flight import frame_of, px4_flight
from app.autopilots.px4.replica.parameters import in_accelerations
from app.autopilots.px4.replica_check import px4_loop_log
from app.autopilots.recording import Recording
from app.core.analysis.analysis import Grade
from app.core.analysis.description import describe
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.margin import gain_margin
from app.core.analysis.segment import Segment
from app.core.analysis.vehicle_fit import fit_copter
from app.core.errors import InputError, TrajectoryError
from app.core.models.copter import GRAVITY_M_S2
from app.log_library.content import analyze_content, read_start
from app.log_library.schemas import LogAnswer, ManoeuvreNumbers, UsualNumbers
from tests.core.tuning.flying import compiled_only
from tests.logs.recorded import recorded
from tests.logs.written_older_px4 import (
    COPTER,
    GAINS,
    LAYOUTS,
    MANOEUVRES,
    OLDER_GAINS,
    RELEASES,
    Written,
    parameters_of,
)

DESCRIBED = ("1.5", "1.7")
OLDER = ("1.8", "1.9", "1.10")
NEWER = ("1.11", "1.12", "1.13", "1.14", "1.16")
RECORDED_HOVER = 0.4925
"""Of the recorded vehicle, from its own log."""


def read(written: Written) -> Recording:
    return read_px4(io.BytesIO(written.content))


def flown(written: Written) -> LoggedFlight:
    return px4_flight(read(written), "flight.ulg")


def answered(written: Written) -> LogAnswer:
    return analyze_content(written.content, None, "flight.ulg").answer


def refused(written: Written) -> tuple[str, str, list[str]]:
    with pytest.raises(TrajectoryError) as refusal:
        flown(written)
    (problem,) = refusal.value.problems
    return problem.field, problem.code, [*problem.named]


def gains_of(layout: str) -> dict[str, float]:
    return dict(OLDER_GAINS if LAYOUTS[layout].older else GAINS)


@pytest.mark.parametrize("manoeuvre", MANOEUVRES)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_flight_of_every_release_is_described(layout: str, manoeuvre: str) -> None:
    recording = read(Written(layout=layout, manoeuvre=manoeuvre))
    signals = signals_of(recording)
    assert signals is not None
    description = describe(signals)
    assert description is not None
    is_recorded = layout in NEWER and manoeuvre != "plain"
    assert description.hover_throttle == pytest.approx(RECORDED_HOVER if is_recorded else 0.42, abs=0.003)
    assert description.deviation_mean_m is not None
    assert description.oscillation is None
    assert recording.release == dict(zip(LAYOUTS, RELEASES, strict=True))[layout]


@compiled_only
@pytest.mark.parametrize("manoeuvre", ["takeoff", "plain"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_flights_without_steps_have_the_margins_of_their_own_gains(layout: str, manoeuvre: str) -> None:
    answer = answered(Written(layout=layout, manoeuvre=manoeuvre)).tuning
    (reason,) = answer.reasons
    if layout in DESCRIBED:
        assert (answer.grade, reason.code) == (Grade.DESCRIPTION, "column_missing")
        assert reason.field == "vehicle_local_position_setpoint.thrust[2]"
        return
    ends_at_once = layout in NEWER and manoeuvre == "takeoff"
    assert reason.code == ("only_takeoffs_or_landings" if ends_at_once else "no_altitude_changes")
    assert answer.grade is Grade.PARTIAL
    assert isinstance(answer.numbers, UsualNumbers)
    present = answer.numbers.assessments[0]
    assert present.gains == pytest.approx(gains_of(layout))
    assert present.margin > 2.0


@pytest.mark.parametrize("layout", OLDER)
@pytest.mark.parametrize("manoeuvre", ["steps", "smooth"])
def test_the_vehicle_and_the_gains_of_older_steps_are_right(layout: str, manoeuvre: str) -> None:
    """Slope, lag and drag within three standard deviations, hover throttle to 0.003; the gains of an acceleration are
    those of thrust times g over the hover throttle."""
    flight = flown(Written(layout=layout, manoeuvre=manoeuvre))
    assert isinstance(flight.loop, Px4Loop)
    assert flight.loop.named(flight.loop.gains) == pytest.approx(OLDER_GAINS)
    expected = OLDER_GAINS["MPC_Z_VEL_P"] * GRAVITY_M_S2 / COPTER.hover_throttle
    assert flight.loop.gains["MPC_Z_VEL_P_ACC"] == pytest.approx(expected, rel=0.01)
    found, known = fit_copter(flight), COPTER.linear
    assert found.mean.hover_throttle == pytest.approx(known.hover_throttle, abs=0.003)
    for name in ("thrust_slope", "motor_lag_s", "drag_1_s"):
        assert abs(getattr(found.mean, name) - getattr(known, name)) < 3.0 * getattr(found.deviation, name), name


def test_when_the_thrust_of_steps_jumped_between_ten_rows_a_second_is_not_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flight = flown(Written(layout="1.9"))
    found = fit_copter(flight).deviation.motor_lag_s
    monkeypatch.setattr(Segment, "jumps", property(lambda self: np.zeros(len(self.time_s))))
    assert found > 1.2 * fit_copter(flight).deviation.motor_lag_s


@pytest.mark.parametrize("layout", NEWER)
def test_newer_steps_are_read_as_from_their_own_log(layout: str) -> None:
    """At ten instead of 125 positions a second: the deviation to 1 mm."""
    original = px4_flight(read_px4(io.BytesIO(recorded("px4_steps.ulg"))), "flight.ulg")
    flight = flown(Written(layout=layout))
    assert flight.loop.gains == pytest.approx(original.loop.gains)
    assert flight.error_m == pytest.approx(original.error_m, abs=1e-3)
    for one, other in zip(flight.segments, original.segments, strict=True):
        at_s = one.time_s[(one.time_s > other.time_s[0]) & (one.time_s < other.time_s[-1])]
        for name, close in {"throttle": 1e-3, "assumed_hover": 1e-3, "v_t_m_s": 0.01, "z_d_m": 1e-3}.items():
            values = [np.interp(at_s, each.time_s, getattr(each, name)) for each in (one, other)]
            assert np.abs(values[0] - values[1]).max() < close, name


@pytest.mark.parametrize("layout", NEWER)
def test_without_an_estimate_thrust_and_acceleration_tell_the_assumed_hover_throttle(layout: str) -> None:
    (segment,) = flown(Written(layout=layout, manoeuvre="plain")).segments
    assert segment.assumed_hover == pytest.approx(np.full(len(segment.time_s), 0.42), abs=1e-6)


@compiled_only
@pytest.mark.complete
@pytest.mark.parametrize(("layout", "manoeuvre"), [*((each, "steps") for each in (*OLDER, *NEWER)), ("1.9", "smooth")])
def test_steps_are_answered_in_full(layout: str, manoeuvre: str) -> None:
    """The predicted deviation of the gains flown is that of the flight to 12 %."""
    answer = answered(Written(layout=layout, manoeuvre=manoeuvre))
    tuning, numbers = answer.tuning, answer.tuning.numbers
    assert (tuning.grade, tuning.proposes, tuning.starts_campaign) == (Grade.FULL, True, layout in NEWER)
    assert isinstance(numbers, ManoeuvreNumbers)
    assert numbers.assessments[0].gains == pytest.approx(gains_of(layout))
    assert numbers.assessments[0].error_m == pytest.approx(numbers.behaviour.error_m, rel=0.12)
    assert numbers.proposed is not None
    assert numbers.proposed.gains.keys() == gains_of(layout).keys()
    assert numbers.proposed.error_m < 0.95 * numbers.assessments[0].error_m


@compiled_only
def test_climb_rates_that_were_fed_forward_and_not_logged_leave_a_partial_answer() -> None:
    """A mission under release 1.8: its set-points are not logged, but the targets are."""
    answer = answered(Written(layout="1.8", manoeuvre="smooth")).tuning
    (reason,) = answer.reasons
    assert (answer.grade, reason.code, reason.field) == (Grade.PARTIAL, "feed_forward_unknown", "trajectory_setpoint")
    assert isinstance(answer.numbers, ManoeuvreNumbers)
    (present,) = answer.numbers.assessments
    assert present.gains == pytest.approx(OLDER_GAINS)
    assert present.error_m == pytest.approx(answer.numbers.behaviour.error_m, rel=0.12)
    assert not answer.proposes


@compiled_only
@pytest.mark.complete
def test_no_campaign_starts_with_gains_that_it_does_not_fly() -> None:
    with pytest.raises(InputError, match="no better gains for a campaign"):
        read_start(Written(layout="1.9").content, None, "flight.ulg")


def test_a_loop_with_gains_of_thrust_is_as_stiff_whatever_hover_throttle_is_set() -> None:
    one, other = (
        replace(px4_loop(in_accelerations({**OLDER_GAINS, "MPC_THR_HOVER": hover}, 0.42)), thrust_gains_at=0.42)
        for hover in (0.3, 0.5)
    )
    assert (one.step_s, one.hover_limits) == (0.02, None)
    assert gain_margin(one, COPTER.linear) == pytest.approx(gain_margin(other, COPTER.linear), rel=1e-3)
    assert one.named(one.rules(0.42)["PX4's default gains"]) == pytest.approx(
        {"MPC_Z_P": 1.0, "MPC_Z_VEL_P": 0.2, "MPC_Z_VEL_I": 0.02, "MPC_Z_VEL_D": 0.0}
    )


REVERSED = {**parameters_of("1.11"), "MPC_Z_VEL_D_ACC": 0.1}


@pytest.mark.parametrize("manoeuvre", MANOEUVRES)
def test_the_release_with_the_wrong_sign_of_the_derivative_is_described_alone(manoeuvre: str) -> None:
    written = Written(layout="1.11", manoeuvre=manoeuvre, parameters=REVERSED, release=0x010B00FF)
    assert refused(written) == ("MPC_Z_VEL_D_ACC", "derivative_reversed", ["1.11.0"])
    answer = answered(written)
    assert (answer.release, answer.tuning.grade, answer.tuning.numbers) == ("1.11.0", Grade.DESCRIPTION, None)


@pytest.mark.parametrize(
    "options", [{"release": 0x010B01FF, "parameters": REVERSED}, {"release": 0x010B00FF}, {"parameters": REVERSED}]
)
def test_without_the_term_or_in_another_release_it_is_read(options: dict[str, Any]) -> None:
    assert flown(Written(layout="1.11", **options)).segments


@pytest.mark.parametrize(
    ("packed", "release"),
    [
        (0x010F01FF, "1.15.1"),
        (0x010D0000, "1.13.0-dev"),
        (0x01110040, "1.17.0-alpha"),
        (0x010C00C0, "1.12.0-rc"),
        (0, ""),
        (0xFFFFFFFF, ""),
        (0x000000FF, ""),
        (0x01090201, ""),
    ],
)
def test_the_release_is_told_if_it_is_one(packed: int, release: str) -> None:
    assert read(Written(layout="1.9", manoeuvre="plain", release=packed)).release == release


TARGET = "vehicle_local_position_setpoint"
WITHOUT_GAINS = {"MPC_THR_HOVER": 0.5, "MPC_Z_P": 1.0}
NAN = float("nan")
DAMAGED = Written(layout="1.9", manoeuvre="smooth")


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (Written(layout="1.12", replaced={("target", "az"): NAN}), (TARGET, "not_numbers", [])),
        (
            Written(layout="1.8", renamed=("float[3] thrust", "float[3] xhrust")),
            (f"{TARGET}.thrust[2]", "column_missing", []),
        ),
        (
            Written(layout="1.12", renamed=("float[3] acceleration", "float[3] xcceleration")),
            (f"{TARGET}.acceleration[2]", "column_missing", []),
        ),
        (Written(layout="1.8", replaced={("target", "tz"): NAN}), (TARGET, "not_numbers", [])),
        (Written(layout="1.8", parameters=WITHOUT_GAINS), ("MPC_Z_VEL_P", "parameter_missing", [])),
        (Written(layout="1.12", parameters=WITHOUT_GAINS), ("MPC_Z_VEL_P_ACC", "parameter_missing", [])),
        (
            Written(layout="1.9", parameters={**parameters_of("1.9"), "MPC_Z_VEL_P": 0.0}),
            ("MPC_Z_VEL_P", "parameter_not_positive", []),
        ),
        (Written(layout="1.11", without=("trajectory_setpoint",)), ("trajectory_setpoint", "message_missing", [])),
        (Written(layout="1.8", without=("vehicle_land_detected",)), ("takeoff_status", "message_missing", [])),
        (Written(layout="1.8", replaced={("status", "rotors"): 0.0}), ("file", "not_a_copter", ["plane"])),
        (Written(layout="1.12", replaced={("status", "rotors"): 2.0}), ("file", "not_a_copter", ["plane"])),
        (
            Written(layout="1.10", parameters={**parameters_of("1.10"), "SYS_AUTOSTART": 13006}),
            ("file", "not_a_copter", ["VTOL"]),
        ),
        (
            Written(layout="1.8", parameters={**parameters_of("1.8"), "MAV_TYPE": 22}),
            ("file", "not_a_copter", ["VTOL"]),
        ),
    ],
)  # fmt: skip
def test_a_refusal_has_the_code_of_its_cause(written: Written, expected: tuple[str, str, list[str]]) -> None:
    assert refused(written) == expected


@pytest.mark.parametrize(
    ("rotors", "frame"),
    [
        ((0.0, 1.0, 1.0, 1.0, 1.0, 0.0), ""),
        ((1.0, 1.0, 1.0, 0.0, 1.0, 1.0), "VTOL"),
        ((1.0, 0.0, 0.0, 0.0, 0.0, 1.0), "plane"),
    ],
)
def test_the_kind_of_vehicle_is_that_of_the_status_while_armed(rotors: tuple[float, ...], frame: str) -> None:
    """The takeoff's first and last report are of disarmed motors, as at boot, when it is not known yet."""
    assert frame_of(read(Written(layout="1.8", manoeuvre="takeoff", replaced={("status", "rotors"): rotors}))) == frame


def test_a_flight_without_thrust_is_refused_and_has_no_margins() -> None:
    written = Written(layout="1.8", replaced={("target", "tz"): 0.0, ("thrust", "up"): 0.0})
    assert refused(written) == (TARGET, "not_numbers", [])
    assert answered(written).tuning.grade is Grade.DESCRIPTION


@given(st.data())
@settings(max_examples=15, deadline=None)
def test_a_damaged_log_of_an_older_release_is_read_or_refused(data: st.DataObject) -> None:
    content = bytearray(DAMAGED.content)
    for place, value in data.draw(
        st.lists(st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255)), max_size=30)
    ):
        content[place] = value
    with suppress(InputError):
        for segment in px4_flight(read_px4(io.BytesIO(bytes(content))), "flight.ulg").segments:
            assert np.isfinite(segment.z_m + segment.v_d_m_s + segment.throttle + segment.assumed_hover).all()


def test_a_plane_is_not_described() -> None:
    answer = answered(Written(layout="1.8", replaced={("status", "rotors"): 0.0}))
    assert (answer.frame, answer.tuning.grade) == ("plane", Grade.REFUSED)


@pytest.mark.parametrize("thrust", [NAN, 1.5, -0.7])
def test_what_is_no_thrust_of_the_body_is_left_out(thrust: float) -> None:
    """As of the controls of a plane or a VTOL, or damaged: the targets of the thrust remain."""
    hostile = Written(layout="1.11", replaced={("thrust", "up"): thrust})
    (segment,), (alone,) = (
        flown(each).segments for each in (hostile, replace(hostile, without=("actuator_controls_0",)))
    )
    at_s = np.linspace(segment.time_s[0], segment.time_s[-1], 50)
    assert segment.motor_throttle(at_s) == pytest.approx(alone.motor_throttle(at_s))


@pytest.mark.parametrize(
    ("layout", "problem"),
    [
        ("1.7", f"{TARGET}.acceleration[2]: is missing"),
        ("1.9", f"{TARGET}.acceleration[2]"),
        ("1.11", "takeoff_status"),
    ],
)
def test_the_comparison_with_the_replica_names_what_older_logs_lack(layout: str, problem: str) -> None:
    with pytest.raises(InputError) as refusal:
        px4_loop_log(read(Written(layout=layout)), name="flight.ulg")
    assert problem in str(refusal.value)


@pytest.mark.parametrize(("given", "limits"), [({}, (0.0, 0.9)), ({"HTE_THR_RANGE": 0.2}, (0.3, 0.7))])
def test_the_estimate_has_limits_where_they_are_a_parameter(
    given: dict[str, float], limits: tuple[float, float]
) -> None:
    loop = flown(Written(layout="1.12", parameters={**parameters_of("1.12"), **given})).loop
    assert loop.hover_limits == pytest.approx(limits)


def test_without_gains_in_the_log_there_is_no_loop() -> None:
    assert loop_of(read(Written(layout="1.8", parameters=WITHOUT_GAINS)), 30.0, 0.42) is None


def test_the_parameter_file_has_the_names_and_units_of_the_release() -> None:
    loop = flown(Written(layout="1.10")).loop
    proposed = loop.named({**loop.gains, "MPC_Z_P": 1.5, "MPC_Z_VEL_P_ACC": 8.0})
    hover = loop.gains["MPC_Z_VEL_P_ACC"] * 4.0  # of 0.25 thrust per m/s
    assert proposed["MPC_Z_VEL_P"] == pytest.approx(8.0 / hover, rel=1e-6)
    assert "1\t1\tMPC_Z_VEL_I\t0.1\t9" in loop.parameter_lines(loop.named(loop.gains), proposed)
