"""Replay of a recorded run of the autopilot's vertical loop through the replica."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.vertical_loop import VerticalLoop

INPUTS: Final = ("mode", "target", "kp", "ki", "kd", "z", "zd", "r33", "in_flight")
OUTPUTS: Final = ("z_ref", "zd_ref", "zdd_ref", "z_sum_err", "ff_cmd", "fb_cmd", "thrust")


@dataclass(frozen=True, slots=True)
class LoopTrace:
    """Recorded inputs and outputs of the loop, one row per step, all 32-bit integers.

    `inputs` has shape (n, 9) in the order of `INPUTS`, modes as in `vertical_loop.MODES`; `outputs` has shape (n, 7) in
    the order of `OUTPUTS`; n ≥ 1.
    """

    inputs: NDArray[np.int64]
    outputs: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.inputs)


@dataclass(frozen=True, slots=True)
class Replay:
    """Comparison of the replica with a trace: rows replayed, and the largest |difference| of each output column."""

    rows: int
    largest_difference: Mapping[str, int]
    first_different_row: int | None

    @property
    def exact(self) -> bool:
        return self.first_different_row is None


def replayed(trace: LoopTrace) -> NDArray[np.int64]:
    """The replica's own outputs, shape (n, 7), started at the first row's z and zd and stepped once per row."""
    loop = VerticalLoop()
    computed = np.empty_like(trace.outputs)
    rows = trace.inputs.tolist()
    loop.start(rows[0][INPUTS.index("z")], rows[0][INPUTS.index("zd")])
    for row, (mode, target, kp, ki, kd, z, zd, r33, in_flight) in enumerate(rows):
        thrust = loop.step(mode, target, kp, ki, kd, z, zd, r33, bool(in_flight))
        computed[row] = (loop.z_ref, loop.zd_ref, loop.zdd_ref, loop.z_sum_err, loop.ff_cmd, loop.fb_cmd, thrust)
    return computed


def replay_trace(trace: LoopTrace) -> Replay:
    """Compare every output of every row with the replica's."""
    return compared(trace, replayed(trace))


def compared(trace: LoopTrace, computed: NDArray[np.int64]) -> Replay:
    """Compare `computed`, shape (n, 7), with the recorded outputs."""
    difference = np.abs(computed - trace.outputs)
    different = np.flatnonzero(difference.any(axis=1))
    return Replay(
        len(trace),
        {name: int(value) for name, value in zip(OUTPUTS, difference.max(axis=0), strict=True)},
        int(different[0]) if different.size else None,
    )
