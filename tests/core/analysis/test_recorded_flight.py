"""A flight over a link as a log: the time of the set points, the reference's rates, the noise behind the throttle."""

from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.ardupilot.experiments import ardupilot_loop, read_ardupilot, shaped_reference
from app.autopilots.px4.experiments import px4_loop, read_px4
from app.core.analysis.prediction import FlightModel
from app.core.analysis.recorded_flight import FlownSteps
from app.core.analysis.segment import FinerSegment
from app.core.errors import TrajectoryError
from app.core.models.copter import Copter
from app.core.models.set_points import SetPoints
from app.core.records.trajectory import Trajectory
from tests.core.tuning.flying import compiled_only

STEPS = FlownSteps(set_points=SetPoints((0.0, 4.0, 7.0), (3.0, 2.0, 3.0)), begin_s=4.0, end_s=10.0)
LATE = SetPoints((0.0, 4.13, 7.02), (3.0, 2.0, 3.0))
TIME_S = np.arange(0.0, 19.4, 0.02)


def recorded(**channels: float) -> Trajectory:
    """A flight exactly on the shaped target, whose set points were late; the channels given are constant."""
    loop = ardupilot_loop({})
    steps_s = np.arange(0.0, 19.4, loop.step_s)
    reference = shaped_reference(loop, LATE, steps_s)
    z, v = (np.interp(TIME_S, steps_s, reference[:, column]) for column in range(2))
    throttle = 0.35 + np.random.default_rng(1).normal(0.0, 0.01, len(TIME_S))
    found = {"altitude_m": z, "climb_rate_m_s": v, "throttle": throttle, "reference_m": z}
    constant = {name: np.full_like(TIME_S, value) for name, value in channels.items()}
    return Trajectory(TIME_S, found | constant, "mavlink", "vehicle")


@compiled_only
def test_arducopters_reference_is_shaped_again_with_the_set_points_when_they_took_effect() -> None:
    log = read_ardupilot(ardupilot_loop({}), recorded(), STEPS)
    (segment,) = log.segments
    assert (segment.time_s[0], segment.time_s[-1]) == (2.0, 10.0)
    assert np.abs(segment.z_d_m - segment.z_m).max() < 0.004
    assert np.abs(segment.v_d_m_s - segment.v_m_s).max() < 0.02
    assert np.abs(segment.a_m_s2[1:] - (np.diff(segment.v_m_s) / 0.1)).max() < 1e-9
    assert log.activity == pytest.approx(0.0084, abs=0.0005), "of 0.01: a part of it is in the low-pass"


@compiled_only
def test_a_step_of_the_loop_at_the_end_of_the_flight_is_its_last_row() -> None:
    """Seen: rounding puts the last step 2e-12 s behind the last row, and the motors' throttle was refused."""
    (segment,) = read_ardupilot(ardupilot_loop({}), recorded(), replace(STEPS, begin_s=6.1, end_s=19.1)).segments
    assert isinstance(segment, FinerSegment)
    assert np.all(np.diff(segment.motor_time_s) > 0.0)
    assert segment.motor_time_s[-1] == segment.time_s[-1] == 19.1
    assert segment.motor_values[-1] == pytest.approx(segment.throttle_filtered[-1])


@compiled_only
@pytest.mark.parametrize(
    ("channels", "missing", "field", "reason"),
    [
        ({}, "throttle", "throttle", "is not among the recorded channels (altitude_m, climb_rate_m_s, reference_m)"),
        ({"throttle": 0.4}, "", "throttle", "has a constant throttle: nothing can be learned from it"),
        ({"reference_m": 3.5}, "", "reference_m", "from the target that ArduCopter shapes from the set points"),
    ],
)
def test_a_record_that_does_not_suffice_is_refused(
    channels: dict[str, float], missing: str, field: str, reason: str
) -> None:
    whole = recorded(**channels)
    record = replace(whole, channels={name: each for name, each in whole.channels.items() if name != missing})
    with pytest.raises(TrajectoryError) as refused:
        read_ardupilot(ardupilot_loop({}), record, STEPS)
    (problem,) = refused.value.problems
    assert (problem.field, reason in problem.reason) == (field, True)


def test_a_record_with_rare_samples_is_refused() -> None:
    whole = recorded()
    rare = Trajectory(TIME_S[::10], {name: each[::10] for name, each in whole.channels.items()}, "mavlink", "vehicle")
    with pytest.raises(TrajectoryError) as refused:
        read_px4(px4_loop({}), rare, STEPS)
    assert refused.value.problems[0].reason == "has a sample every 0.20 s; 0.06 s are needed"


def test_px4_follows_the_recorded_set_point_with_the_hover_throttle_of_the_flight() -> None:
    loop = px4_loop({"IMU_INTEG_RATE": 250.0, "MPC_Z_VEL_MAX_DN": 1.0})
    assert (loop.step_s, loop.descent_m_s) == (0.008, 1.0)
    (segment,) = read_px4(loop, recorded(), STEPS).segments
    assert segment.assumed_hover == pytest.approx(0.35, abs=0.002)
    assert segment.v_d_m_s.tolist() == [0.0] * len(segment.time_s)


def test_px4_at_one_set_point_has_no_step_that_could_be_late() -> None:
    still = FlownSteps(set_points=SetPoints((0.0,), (3.0,)), begin_s=4.0, end_s=10.0)
    (segment,) = read_px4(px4_loop({}), recorded(reference_m=3.0), still).segments
    assert segment.z_d_m.tolist() == [3.0] * len(segment.z_d_m)
    assert not segment.a_d_m_s2.any(), "nothing is fed forward"


@compiled_only
def test_noise_of_the_accelerometer_follows_from_how_much_the_throttle_moved() -> None:
    log = read_ardupilot(ardupilot_loop({}), recorded(), STEPS)
    model = FlightModel(log, [Copter(hover_throttle=0.35)])
    assert model.fly(log.loop)[1] == pytest.approx(log.activity, rel=0.02)
