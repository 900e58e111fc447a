"""Replay of a recorded run of PX4's vertical loop through the replica."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.replica import vertical as loop
from app.autopilots.px4.replica.parameters import Packed, Parameters
from app.core.records.trajectory import Samples


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTrace:
    """Recorded inputs and outputs of the loop, one row per estimate of position, from disarmed or just armed on.

    `time_s` has shape (n,), `inputs` (n, 15) in the order of `INPUTS`, `outputs` (n, 6) in that of `OUTPUTS`; n ≥ 1.
    Outputs that were not recorded are NaN in all rows. `flown` tells a flight from the loop alone. In a flight the
    recording does not tell whether the loop read a message before or after the estimate with the same time stamp:
    `late_inputs`, shape (n, 15), are the inputs if it read all such messages in the next row.
    """

    parameters: Parameters
    filter_sample_s: float
    flown: bool
    time_s: Samples
    inputs: Samples
    late_inputs: Samples
    outputs: Samples


@dataclass(frozen=True, slots=True)
class Replay:
    """The replica's own outputs, shape (n, 6), with messages read when it fits the recording: in `late_rows` one row
    later than recorded; `armed_before` if the loop was armed one row before the first one."""

    outputs: Samples
    late_rows: tuple[int, ...]
    armed_before: bool


def replayed(trace: LoopTrace) -> Replay:
    """Run the replica from the inputs alone; the outputs decide when an undecided message was read."""
    runs = [_run(trace, armed_before=each) for each in (False, True)]
    return min(runs, key=lambda run: _misfit(run.outputs[:, loop.TAKEOFF], trace.outputs[:, loop.TAKEOFF]))


def _run(trace: LoopTrace, *, armed_before: bool) -> Replay:
    inputs, late = trace.inputs.astype(np.float32), trace.late_inputs.astype(np.float32)
    recorded = ~np.isnan(trace.outputs).all(axis=0)
    state, packed = np.empty(loop.STATE_SIZE, dtype=np.float32), trace.parameters.packed(trace.filter_sample_s)
    loop.start(state, packed)
    if armed_before:
        state, _ = _after(state, packed, inputs[:1])
    undecided = ~np.isclose(inputs, late, rtol=0.0, atol=0.0, equal_nan=True).all(axis=1)
    begin, late_rows, computed = 0, [], []
    for row in np.flatnonzero(undecided).tolist():
        state, before = _after(state, packed, inputs[begin:row])
        options = [_after(state, packed, each[row : row + 1]) for each in (inputs, late)]
        prompt, delayed = (_misfit(outputs[0, recorded], trace.outputs[row, recorded]) for _, outputs in options)
        state, outputs = options[delayed < prompt]
        if delayed < prompt:
            late_rows.append(row)
        computed += [before, outputs]
        begin = row + 1
    computed.append(_after(state, packed, inputs[begin:])[1])
    return Replay(np.concatenate(computed), tuple(late_rows), armed_before)


def _after(state: loop.State, packed: Packed, inputs: NDArray[np.float32]) -> tuple[loop.State, Samples]:
    """State after these rows, and their outputs, shape (n, 6)."""
    state, outputs = state.copy(), np.empty((len(inputs), len(loop.OUTPUTS)), dtype=np.float32)
    loop.rollout(state, packed, inputs, outputs)
    return state, outputs.astype(np.float64)


def _misfit(computed: Samples, recorded: Samples) -> float:
    """Sum of the differences; a value that only one of them has is far off."""
    return float(np.abs(np.nan_to_num(computed, nan=_FAR) - np.nan_to_num(recorded, nan=_FAR)).sum())


_FAR: Final = 1e6
