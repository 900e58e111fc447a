"""PX4's logs as records of the vertical loop, from the log of the real binary as it is and with parts renamed."""

import io
from contextlib import suppress
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.autopilots.px4.log import read_px4
from app.autopilots.px4.replica.parameters import Parameters
from app.autopilots.px4.replica.replay import LoopLog, replica_of
from app.autopilots.px4.replica_check import px4_loop_log
from app.core.errors import InputError
from tests.logs.recorded import recorded

LOG = recorded("px4_takeoff.ulg")


def read(*renamed: tuple[bytes, bytes]) -> LoopLog:
    content = LOG
    for name, other in renamed:
        assert len(name) == len(other)
        assert name in content
        content = content.replace(name, other)
    return px4_loop_log(read_px4(io.BytesIO(content)), name="flight.ulg")


def test_rows_and_parameters_are_those_of_the_flight() -> None:
    """The ramp begins 1.008 s after the first position, the flight at 4.016 s; it lands at 17.97 s."""
    log = read()
    assert asdict(log.parameters) == pytest.approx(asdict(Parameters(velocity_p_1_s=4.2)))
    row_s = log.time_s[log.place] - log.time_s[0]
    assert (row_s[0], row_s[-1]) == pytest.approx((1.104, 17.904), abs=0.01)
    assert row_s[log.flying][0] == pytest.approx(4.096, abs=0.01)
    assert np.median(np.diff(log.time_s)) == pytest.approx(0.008)
    assert np.diff(row_s).max() < 0.11
    assert (log.limit_up_m_s.max(), log.limit_down_m_s.max()) == pytest.approx((3.6, 1.8))
    assert not log.flying[row_s > 16.0].any()


def test_the_log_of_the_real_binary_follows_from_the_replica() -> None:
    """To seven digits; the thrust to what the hover thrust moves between two of its estimates, at most 0.004.

    In an auto mode the set-points change between the rows, so no row follows from the one before.
    """
    log = read()
    replica = replica_of(log)
    apart = {name: np.abs(values - getattr(log, name)) for name, values in replica.items()}
    assert {name: int(np.isfinite(values).sum()) for name, values in apart.items()} == {
        "out_vz_m_s": 58, "out_az_m_s2": 0, "out_thrust": 115}  # fmt: skip
    assert np.nanmax(apart["out_vz_m_s"]) < 1e-6
    assert np.nanmax(apart["out_thrust"]) < 1e-3
    assert np.nanmax(apart["out_thrust"][log.hover == log.parameters.hover_thrust]) < 1e-7
    assert np.ptp(log.out_vz_m_s[np.isfinite(replica["out_vz_m_s"])]) > 2.0


def test_hover_thrust_is_the_parameter_until_an_estimate_is_valid() -> None:
    """Estimates are logged from 5.54 s after the first position on, valid ones from 7.8 s, none after the landing."""
    log = read()
    row_s = log.time_s[log.place] - log.time_s[0]
    assert (log.hover[row_s < 7.6] == 0.5).all()
    later = log.hover[(row_s > 8.0) & (row_s < 17.8)]
    assert (later[0], later[-1]) == pytest.approx((0.519, 0.424), abs=0.003)
    assert (np.abs(np.diff(later)) < 0.004).all()


@pytest.mark.parametrize(
    ("topic", "signal"), [(b"hover_thrust_estimate", "out_thrust"), (b"trajectory_setpoint", "out_vz_m_s")]
)
def test_without_a_message_what_depends_on_it_is_not_computed(topic: bytes, signal: str) -> None:
    log = read((topic, topic.replace(b"t", b"x")))
    computed = np.isfinite(replica_of(log)[signal])
    assert not computed[log.flying].any()


@pytest.mark.parametrize(
    ("renamed", "problem"),
    [
        ((b"vehicle_local_position:", b"vehicle_local_posixion:"), "vehicle_local_position: is missing"),
        ((b"takeoff_status", b"xakeoff_status"), "takeoff_status: is missing"),
        ((b"float MPC_Z_VEL_D_ACC", b"float XPC_Z_VEL_D_ACC"), "MPC_Z_VEL_D_ACC: is missing"),
        ((b"float[3] thrust;", b"float[3] xhrust;"), "vehicle_local_position_setpoint.thrust[2]: is missing"),
    ],
)
def test_a_log_that_cannot_be_compared_is_refused_by_what_is_missing(
    renamed: tuple[bytes, bytes], problem: str
) -> None:
    with pytest.raises(InputError) as refusal:
        read(renamed)
    assert problem in str(refusal.value)


@given(st.integers(16, len(LOG)), st.lists(st.tuples(st.integers(0, 60_000), st.integers(0, 255)), max_size=30))
@settings(max_examples=20, deadline=None)
def test_a_damaged_log_is_read_or_refused(length: int, changes: list[tuple[int, int]]) -> None:
    content = bytearray(LOG[:length])
    for place, value in changes:
        if place < length:
            content[place] = value
    with suppress(InputError):
        log = px4_loop_log(read_px4(io.BytesIO(bytes(content))), name="damaged.ulg")
        assert all(len(values) == len(log.place) for values in replica_of(log).values())
