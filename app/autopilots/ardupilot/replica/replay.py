"""Replay of a recorded run of ArduCopter's vertical loop through the replica."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.autopilots.ardupilot.replica import vertical as loop
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.core.records.trajectory import Samples


@dataclass(frozen=True, slots=True)
class Hover:
    """A start in flight: throttle demanded and filtered, altitude in m, climb rate in m/s and acceleration in m/s²."""

    throttle: float
    z_m: float
    v_m_s: float
    a_m_s2: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTrace:
    """Recorded inputs and outputs of the loop, one row per step of `dt_s`.

    `time_s` has shape (n,), `inputs` (n, 6) in the order of `INPUTS`, `outputs` (n, 8) in that of `OUTPUTS`; n ≥ 1.
    Without `hover` the run starts on the ground, as the throttle begins to rise.
    """

    parameters: Parameters
    dt_s: float
    hover: Hover | None
    time_s: Samples
    inputs: Samples
    outputs: Samples

    @property
    def followed(self) -> NDArray[np.bool_]:
        """Rows after which a replay continues from the recording, shape (n,): those around an active throttle limit.

        There the loop decides by signs, and the recorded inputs are rounded: a decision may fall one step earlier or
        later, and the two runs part for good.
        """
        limited = np.pad(self.inputs[:, -2:].any(axis=1), 1)
        return np.asarray(limited[:-2] | limited[1:-1] | limited[2:])


def replayed(trace: LoopTrace) -> Samples:
    """The replica's own outputs, shape (n, 8): free running, except after the rows in `followed`."""
    state, packed = np.empty(loop.STATE_SIZE, dtype=np.float32), trace.parameters.packed(trace.dt_s)
    if trace.hover is None:
        loop.start_takeoff(state, packed, 0.0)
    else:
        hover = trace.hover
        loop.start_hover(state, packed, hover.throttle, hover.z_m, hover.v_m_s, hover.a_m_s2)
    computed = np.empty_like(trace.outputs)
    loop.rollout(state, packed, trace.inputs, trace.outputs, trace.followed, computed)
    return computed
