"""Replay of a recorded run of PX4's vertical loop through the replica."""

from dataclasses import dataclass

import numpy as np

from app.core.control import px4 as loop
from app.core.control.px4_parameters import Parameters
from app.core.records.trajectory import Samples


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTrace:
    """Recorded inputs and outputs of the loop, one row per estimate of position, from disarmed or just armed on.

    `time_s` has shape (n,), `inputs` (n, 15) in the order of `INPUTS`, `outputs` (n, 6) in that of `OUTPUTS`; n ≥ 1.
    Outputs that were not recorded are NaN in all rows. `flown` tells a flight, in which messages that share a time
    stamp leave some rows undecided, from the loop alone.
    """

    parameters: Parameters
    filter_sample_s: float
    flown: bool
    time_s: Samples
    inputs: Samples
    outputs: Samples


def replayed(trace: LoopTrace) -> Samples:
    """The replica's own outputs, shape (n, 6), free running."""
    state, packed = np.empty(loop.STATE_SIZE, dtype=np.float32), trace.parameters.packed(trace.filter_sample_s)
    loop.start(state, packed)
    computed = np.empty(trace.outputs.shape, dtype=np.float32)
    loop.rollout(state, packed, trace.inputs.astype(np.float32), computed)
    return computed.astype(np.float64)
