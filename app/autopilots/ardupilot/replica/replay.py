"""The replica beside recordings of ArduCopter's vertical loop: a run with a row per step is replayed, and the
vehicle's own log, far below the loop's rate, is compared row by row.

A row of a log is a snapshot of one loop, so what depends on values of the same row alone must follow from them: the
climb rate target and the demanded throttle. The desired motion advances between rows and is shaped again from each to
the next.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.autopilots.ardupilot.replica import vertical as loop
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.autopilots.ardupilot.replica.shaping import square_root
from app.core.records.trajectory import Samples

SHAPED: Final = ("z_d_m", "v_d_m_s", "a_d_m_s2")
_LONGEST_INTERVAL_S: Final = 0.5


class Hover(NamedTuple):
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
    state, packed = np.empty(loop.STATE_SIZE, dtype=np.float32), loop.packed(trace.parameters, trace.dt_s)
    if trace.hover is None:
        loop.start_takeoff(state, packed, 0.0)
    else:
        loop.start_hover(state, packed, *trace.hover)
    computed = np.empty_like(trace.outputs)
    loop.rollout(state, packed, trace.inputs, trace.outputs, trace.followed, computed)
    return computed


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopLog:
    """Rows of the loop in GUIDED, up, in m and s.

    All arrays have shape (n,), and `time_s` increases. `control_per_mille` is the sum of the acceleration controller's
    terms, `hover` the feed-forward throttle; both and `throttle` are NaN where they were not logged with the row.
    `limited` marks rows at a throttle limit. `targets` are the position targets received, time and altitude, in order.
    """

    parameters: Parameters
    rate_hz: float
    time_s: Samples
    z_m: Samples
    z_d_m: Samples
    v_d_m_s: Samples
    a_d_m_s2: Samples
    v_t_m_s: Samples
    hover: Samples
    control_per_mille: Samples
    throttle: Samples
    limited: NDArray[np.bool_]
    targets: Sequence[tuple[float, float]]


def replica_of(log: LoopLog) -> dict[str, Samples]:
    """Signals as the replica computes them from the row itself, or for `SHAPED` from the row before, shape (n,) each;
    NaN where nothing can be computed."""
    return _shaped_again(log) | {
        "v_t_m_s": climb_rate_targets(log.parameters, log.z_d_m - log.z_m, log.v_d_m_s),
        "throttle": log.hover + log.control_per_mille / 1000.0,
    }


def climb_rate_targets(parameters: Parameters, errors_m: Samples, v_d_m_s: Samples) -> Samples:
    """Targets, shape (n,), that follow from the errors of the altitude and the desired climb rates, shape (n,) each."""
    p, acceleration = parameters.position_p_1_s, parameters.acceleration_m_s2
    rates = [square_root(error, p, acceleration, 0.0) for error in errors_m.tolist()]
    return np.array(rates) + v_d_m_s


def _shaped_again(log: LoopLog) -> dict[str, Samples]:
    """Desired motion of each row, shape (n,), from that of the row before.

    NaN before the first target, around throttle limits, and after a gap.
    """
    computed = np.full((len(log.time_s), len(SHAPED)), np.nan)
    state = np.zeros(loop.STATE_SIZE)
    for row in range(1, len(log.time_s)):
        begin_s, end_s = float(log.time_s[row - 1]), float(log.time_s[row])
        known = [target for target in log.targets if target[0] < end_s]
        free = not (log.limited[row - 1] or log.limited[row])
        if free and known and known[0][0] < begin_s and end_s - begin_s <= _LONGEST_INTERVAL_S:
            state[[loop.Z_D, loop.V_D, loop.A_D]] = log.z_d_m[row - 1], log.v_d_m_s[row - 1], log.a_d_m_s2[row - 1]
            _advance(state, log, begin_s, end_s, known)
            computed[row] = state[[loop.Z_D, loop.V_D, loop.A_D]]
    return dict(zip(SHAPED, computed.T, strict=True))


def _advance(
    state: Samples, log: LoopLog, begin_s: float, end_s: float, targets: Sequence[tuple[float, float]]
) -> None:
    """Take the loop's steps between two rows; a target counts from the step after its receipt."""
    steps = max(1, round((end_s - begin_s) * log.rate_hz))
    dt_s = (end_s - begin_s) / steps
    packed = loop.packed(log.parameters, dt_s)
    for step in range(1, steps + 1):
        loop.shape(state, packed, [z for time_s, z in targets if time_s < begin_s + step * dt_s][-1])
