"""Altitude steps in telemetry logs: what reaches the analysis, however the log was recorded."""

import io
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.copter_tlog import copter_steps
from app.autopilots.px4.experiments import Px4Loop
from app.autopilots.tlog import read_tlog
from app.core.analysis.loop import LoggedFlight
from app.core.errors import InputError
from tests.logs.recorded import recorded
from tests.logs.written import NEWER_PARAMETERS
from tests.logs.written_tlog import CLIMB_AND_DESCENT, LOITER, PX4_RECORDING, Recording, flown, repeated_and_late

STEPS = Recording()


def read(content: bytes) -> LoggedFlight:
    flight = copter_steps(read_tlog(io.BytesIO(content)), "flight.tlog")
    assert flight is not None
    return flight


def problems_in(content: bytes) -> dict[str, str]:
    with pytest.raises(InputError) as refused:
        read(content)
    return {problem.field: problem.reason for problem in refused.value.problems}


@pytest.fixture(scope="module")
def flight() -> LoggedFlight:
    return read(STEPS.content)


def test_the_flight_is_the_one_that_the_vehicle_flew(flight: LoggedFlight) -> None:
    """The reference is shaped again from the set points; 2 s before the first step it begins."""
    segment, signals = flight.segments[0], flown("ardupilot", CLIMB_AND_DESCENT)
    time_s = 0.02 * np.arange(len(signals.altitude_m))
    began_s = 5.0 - 2.0 + segment.time_s - segment.time_s[0]
    for mine, known, within in (
        (segment.z_m, signals.altitude_m, 1e-3),
        (segment.v_m_s, signals.climb_rate_m_s, 5e-3),
        (segment.throttle, signals.throttle, 5e-3),
        (segment.z_d_m, signals.reference_m, 0.02),
    ):
        assert mine == pytest.approx(np.interp(began_s, time_s, known), abs=within)
    assert segment.time_s[-1] - segment.time_s[0] == pytest.approx(2.0 + 13.0, abs=0.05)
    assert flight.activity is not None
    assert "PSC_VELZ_P" not in flight.assumed
    assert {"WPNAV_SPEED_UP", "PSC_JERK_Z"} <= set(flight.assumed)


@pytest.mark.parametrize(
    "written",
    [
        lambda: repeated_and_late(STEPS.content),
        lambda: STEPS.content[:-9],
        lambda: replace(STEPS, parameters_after=True).content,
        lambda: replace(STEPS, boots_at_s=2.0).content,
        lambda: replace(STEPS, changes=((2.0, "PSC_POSZ_P", 1.0),)).content,
        lambda: replace(STEPS, set_points=(*CLIMB_AND_DESCENT, (17.9, 7.0))).content,
        lambda: b"".join((STEPS.content, replace(STEPS, set_points=((0.0, 5.0),), lasts_s=6.0).content)),
    ],
    ids=[
        "repeated and late",
        "cut off",
        "parameters read later",
        "restarted",
        "written again",
        "a step at the end",
        "two flights",
    ],
)
def test_how_the_log_was_recorded_makes_no_difference(written: Callable[[], bytes], flight: LoggedFlight) -> None:
    found = read(written())
    assert found.loop.gains == flight.loop.gains
    assert found.error_m == pytest.approx(flight.error_m, abs=5e-4)
    assert found.throttle_mean == pytest.approx(flight.throttle_mean, abs=1e-3)


def test_other_vehicles_and_components_in_the_log_are_left_out(flight: LoggedFlight) -> None:
    """One that stands by, and a gimbal of the same system with a parameter of that name."""
    log = STEPS.written()
    began_s = log.now_s
    stands_by = replace(STEPS, set_points=((0.0, 5.0),), lasts_s=6.0, system=9).content
    log.component("param_value", b"PSC_POSZ_P", 7.0, 9, 900, 0)
    log.now_s = began_s
    found = read(stands_by + log.content)
    assert found.loop.gains == flight.loop.gains
    assert found.error_m == pytest.approx(flight.error_m, abs=1e-6)


def test_px4_flies_the_set_point_itself() -> None:
    found = read(PX4_RECORDING.content)
    (segment,) = found.segments
    assert isinstance(found.loop, Px4Loop)
    assert found.loop.vehicle == 1
    assert set(segment.z_d_m.tolist()) >= {5.0, 6.0}
    assert not segment.v_d_m_s.any()
    assert found.error_m == pytest.approx(0.17, abs=0.02)


@pytest.mark.complete
def test_rows_in_which_more_than_a_position_was_commanded_are_left_out() -> None:
    """The vehicle reports the altitude alone: a push would be taken for a disturbance. Zeros, and those given to
    another vehicle, change nothing."""
    whole, log = read(PX4_RECORDING.content), PX4_RECORDING.written()
    for system, mask, afz in ((1, 0xCF8, 0.0), (9, 0xCF8, 2.0), (1, 0xDF8, 2.0)):
        log.ground("set_position_target_local_ned", 0, system, 1, 1, mask, *[0.0] * 2, -5.0, *[0.0] * 5, afz, 0.0, 0.0)
    assert read(log.content + PX4_RECORDING.content).error_m == pytest.approx(whole.error_m, abs=1e-6)
    log = PX4_RECORDING.written()
    log.ground("set_position_target_local_ned", 0, 1, 1, 1, 0xCF8, *[0.0] * 2, -5.0, *[0.0] * 5, 2.0, 0.0, 0.0)
    pushed = replace(PX4_RECORDING, set_points=((0.0, 5.0), (5.0, 8.0))).content
    assert read(log.content + pushed).error_m == pytest.approx(whole.error_m, abs=1e-6)


def test_the_names_and_units_of_release_4_7_are_kept(flight: LoggedFlight) -> None:
    found = read(replace(STEPS, parameters=NEWER_PARAMETERS).content)
    assert isinstance(found.loop, ArduPilotLoop)
    assert found.loop.names["PSC_ACCZ_P"] == ("PSC_D_ACC_P", 0.1)
    assert found.loop.gains == pytest.approx(flight.loop.gains)
    assert "PSC_D_VEL_I" in found.assumed


def test_all_that_is_missing_is_told_at_once() -> None:
    """As a ground station records by default: few messages, another mode."""
    log = replace(STEPS, every=12, mode=LOITER, parameters={"PSC_POSZ_P": 1.0}, without=("attitude_target",))
    assert set(problems_in(log.content)) == {
        "LOCAL_POSITION_NED",
        "NAV_CONTROLLER_OUTPUT",
        "ATTITUDE_TARGET",
        "POSITION_TARGET_LOCAL_NED",
        "HEARTBEAT",
        "PSC_VELZ_P",
        "PSC_ACCZ_P",
        "PSC_ACCZ_I",
        "MOT_THST_HOVER",
    }


@pytest.mark.parametrize(
    ("log", "field", "reason"),
    [
        (
            replace(STEPS, changes=((17.5, "PSC_POSZ_P", 2.0),), unread=("PSC_POSZ_P",)),
            "PSC_POSZ_P",
            "after the flight",
        ),
        (replace(STEPS, parameters={**STEPS.parameters, "PSC_ACCZ_I": 0.0}), "PSC_ACCZ_I", "must be positive, got 0"),
        (replace(STEPS, armed=False), "HEARTBEAT", "never reports armed motors"),
        (
            replace(STEPS, set_points=((0.0, 5.0), (5.0, 7.0), (5.4, 5.0))),
            "POSITION_TARGET_LOCAL_NED",
            "moves again within 1 s",
        ),
        (replace(STEPS, lasts_s=3.0), "file", "leaves too short a time to analyse: 4 s are needed"),
        (replace(STEPS, parameters={**STEPS.parameters, "PSC_ACCZ_PDMX": 1.0}), "PSC_ACCZ_PDMX", "must be 0"),
    ],
)
def test_a_flight_that_cannot_be_used_is_refused(log: Recording, field: str, reason: str) -> None:
    found = problems_in(log.content)
    assert reason in found[field]


def test_a_telemetry_log_of_paparazzi_is_not_one_of_these() -> None:
    assert copter_steps(read_tlog(io.BytesIO(recorded("paparazzi_283_13_82.tlog"))), "flight.tlog") is None
