"""The replica against recorded runs of the original loop (origin: tests/data/vertical_loop/README.md)."""

from pathlib import Path

import numpy as np
import pytest

from app.autopilots.paparazzi.replica_check import read_loop_trace
from app.core.control.vertical_guidance import (
    FB_CMD,
    FF_CMD,
    FULL_THRUST,
    INPUTS,
    INT32_MAX,
    LARGEST_PRODUCT,
    OUTPUTS,
    Z_REF,
    Z_SUM_ERR,
    ZD_REF,
    ZDD_REF,
    LoopTrace,
    detect_flight,
    new_state,
    replayed,
    step,
)

TRACES = sorted((Path(__file__).parents[2] / "data" / "vertical_loop").glob("*.csv.gz"))


def column(trace: LoopTrace, name: str) -> list[int]:
    source, names = (trace.inputs, INPUTS) if name in INPUTS else (trace.outputs, OUTPUTS)
    return [int(value) for value in source[:, names.index(name)]]


def test_all_seven_recorded_traces_are_here() -> None:
    assert len(TRACES) == 7


@pytest.mark.parametrize("path", TRACES, ids=lambda path: path.name)
def test_the_replica_reproduces_every_column_of_every_row(path: Path) -> None:
    trace = read_loop_trace(path)
    assert len(trace) >= 6144
    np.testing.assert_array_equal(replayed(trace), trace.outputs)


@pytest.mark.parametrize(
    "path", [path for path in TRACES if not path.name.startswith("wild")], ids=lambda path: path.name
)
def test_in_flight_is_detected_when_the_recorded_autopilot_detected_it(path: Path) -> None:
    """Within one step: the recorder summed 0.05 s in floating point, the detector here counts exactly."""
    trace = read_loop_trace(path)
    thrusts = column(trace, "thrust")
    state, detected, before = new_state(0, 0), [], 0
    for row, thrust in zip(trace.inputs.tolist(), thrusts, strict=True):
        detected.append(detect_flight(state, before))
        before = step(state, *row)
        assert before == thrust
    assert abs(detected.index(True) - column(trace, "in_flight").index(1)) <= 1
    assert all(detected[detected.index(True) :])


def test_gains_that_wrap_the_integrator_turn_full_up_into_full_down_and_are_reported() -> None:
    """ki·sum wraps once ki > 2³¹ / 2 000 000 ≈ 1073."""
    thrusts, products = [], []
    for ki in (1073, 1074):
        state = new_state(0, 0)
        thrusts.append([step(state, 1, 3 << 8, 0, ki, 0, 0, 0, 16384, True) for _ in range(4000)][-1])
        products.append(int(state[LARGEST_PRODUCT]))
    assert thrusts == [FULL_THRUST, 0]
    assert products == [1073 * 2_000_000, 1074 * 2_000_000]
    assert products[0] <= INT32_MAX < products[1]


def test_throttle_mode_passes_the_thrust_through_and_keeps_the_last_commands() -> None:
    state = new_state(0, 0)
    step(state, 1, 768, 283, 13, 82, 0, 0, 16384, False)
    commands = state[[FF_CMD, FB_CMD]].tolist()
    assert step(state, 0, 4321, 283, 13, 82, -100, 5, 16384, False) == 4321
    assert state[[FF_CMD, FB_CMD]].tolist() == commands
    assert state[[Z_REF, ZD_REF, ZDD_REF, Z_SUM_ERR]].tolist() == [-100, 5, 0, 0]


def test_a_trace_has_a_length() -> None:
    assert len(LoopTrace(np.zeros((5, 9), dtype=np.int64), np.zeros((5, 7), dtype=np.int64))) == 5
