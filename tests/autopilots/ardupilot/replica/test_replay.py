"""The replica against the log that the real binary wrote of altitude steps (origin: tests/data/logs/README.md)."""

import io
from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.replica.replay import SHAPED, LoopLog, replica_of
from app.autopilots.ardupilot.replica_check import ardupilot_loop_log
from tests.logs.recorded import recorded

COMPARED = (*SHAPED, "v_t_m_s", "throttle")
ARRAYS = (
    "time_s", "z_m", "z_d_m", "v_d_m_s", "a_d_m_s2", "v_t_m_s", "hover", "control_per_mille", "throttle", "limited",
)  # fmt: skip


@pytest.fixture(scope="module")
def steps() -> LoopLog:
    """Two seconds around the command of the first step, which is 3 s after the first position target."""
    log = ardupilot_loop_log(read_ardupilot(io.BytesIO(recorded("arducopter_steps.bin"))), name="steps.bin")
    step_s = log.targets[1][0]
    return chosen(log, (log.time_s > step_s - 1.0) & (log.time_s < step_s + 1.0))


def chosen(log: LoopLog, rows: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> LoopLog:
    return replace(log, **{name: getattr(log, name)[rows] for name in ARRAYS})


def differences(log: LoopLog, name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    logged: np.ndarray[tuple[int], np.dtype[np.float64]] = getattr(log, name)
    return np.abs(logged - replica_of(log)[name])


def test_the_log_of_the_real_binary_is_reproduced(steps: LoopLog) -> None:
    """To rounding within a row, and over the 40 loops between rows to what seven digits leave."""
    replica = replica_of(steps)
    assert tuple(replica) == COMPARED
    largest = {name: np.nanmax(differences(steps, name)) for name in COMPARED}
    allowed = {"z_d_m": 1e-5, "v_d_m_s": 6e-6, "a_d_m_s2": 1e-4, "v_t_m_s": 1e-7, "throttle": 1e-7}
    assert all(largest[name] < allowed[name] for name in COMPARED), largest
    assert np.ptp(steps.z_d_m) > 0.2
    assert [int(np.isfinite(replica[name]).sum()) for name in COMPARED] == [19, 19, 19, 20, 20]


@pytest.mark.parametrize(
    ("array", "signal", "by"),
    [("v_t_m_s", "v_t_m_s", 0.01), ("throttle", "throttle", 0.002), ("v_d_m_s", "v_d_m_s", 0.01)],
)
def test_a_row_that_does_not_follow_is_found(steps: LoopLog, array: str, signal: str, by: float) -> None:
    values = getattr(steps, array).copy()
    values[7] += by
    found = differences(replace(steps, **{array: values}), signal)
    assert found[7] == pytest.approx(by, abs=1e-5)


def test_another_gain_than_flown_is_found(steps: LoopLog) -> None:
    other = replace(steps, parameters=replace(steps.parameters, position_p_1_s=1.2))
    assert np.nanmax(differences(other, "v_t_m_s")) > 1e-3


@pytest.mark.parametrize("without", ["targets", "free rows", "earlier targets"])
def test_the_motion_is_shaped_only_from_a_known_target_and_away_from_throttle_limits(
    steps: LoopLog, without: str
) -> None:
    log = {
        "targets": replace(steps, targets=()),
        "free rows": replace(steps, limited=np.ones(len(steps.time_s), dtype=np.bool_)),
        "earlier targets": replace(steps, targets=((float(steps.time_s[-1]) - 0.01, 5.0),)),
    }[without]
    replica = replica_of(log)
    assert all(np.isnan(replica[name]).all() for name in SHAPED)
    assert np.isfinite(replica["v_t_m_s"]).all()


def test_the_motion_is_not_shaped_across_a_gap(steps: LoopLog) -> None:
    rows = np.ones(len(steps.time_s), dtype=np.bool_)
    rows[6:12] = False
    replica = replica_of(chosen(steps, rows))
    assert np.flatnonzero(np.isnan(replica["z_d_m"])).tolist() == [0, 6]
