"""The replica beside recordings of PX4's vertical loop: a run with a row per step is replayed, and the vehicle's own
log, in which most messages are rarer than the loop runs, is compared row by row.

A row of a log is one run of position control. What depends on values of the same run alone must follow from them: the
velocity target and the thrust. The acceleration target also depends on the integral and the filters, so it is computed
from the row before, through all positions between the two.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.replica import vertical as loop
from app.autopilots.px4.replica.parameters import Parameters
from app.core.records.trajectory import Samples

_SET_POINTS: Final = [loop.INPUTS.index(name) for name in ("set_z_m", "set_vz_m_s", "set_az_m_s2")]
_LIMITS: Final = [loop.INPUTS.index(name) for name in ("limit_up_m_s", "limit_down_m_s")]
_HOVER: Final = loop.INPUTS.index("hover_estimate")
_AT_LIMIT: Final = 1e-4
_LONGEST_INTERVAL_S: Final = 0.02
_FAR: Final = 1e6


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
class TraceReplay:
    """The replica's own outputs, shape (n, 6), with messages read when it fits the recording: in `late_rows` one row
    later than recorded; `armed_before` if the loop was armed one row before the first one."""

    outputs: Samples
    late_rows: tuple[int, ...]
    armed_before: bool


def replayed(trace: LoopTrace) -> TraceReplay:
    """Run the replica from the inputs alone; the outputs decide when an undecided message was read."""
    runs = [_run(trace, armed_before=each) for each in (False, True)]
    return min(runs, key=lambda run: _misfit(run.outputs[:, loop.TAKEOFF], trace.outputs[:, loop.TAKEOFF]))


def _run(trace: LoopTrace, *, armed_before: bool) -> TraceReplay:
    inputs, late = trace.inputs.astype(np.float32), trace.late_inputs.astype(np.float32)
    recorded = ~np.isnan(trace.outputs).all(axis=0)
    state, packed = np.empty(loop.STATE_SIZE, dtype=np.float32), loop.packed(trace.parameters, trace.filter_sample_s)
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
    return TraceReplay(np.concatenate(computed), tuple(late_rows), armed_before)


def _after(state: loop.State, packed: loop.Packed, inputs: NDArray[np.float32]) -> tuple[loop.State, Samples]:
    """State after these rows, and their outputs, shape (n, 6)."""
    state, outputs = state.copy(), np.empty((len(inputs), len(loop.OUTPUTS)), dtype=np.float32)
    loop.rollout(state, packed, inputs, outputs)
    return state, outputs.astype(np.float64)


def _misfit(computed: Samples, recorded: Samples) -> float:
    """Sum of the differences; a value that only one of them has is far off."""
    return float(np.abs(np.nan_to_num(computed, nan=_FAR) - np.nan_to_num(recorded, nan=_FAR)).sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopLog:
    """Positions and rows of the loop, down, in m and s.

    The positions have shape (n,), and `time_s` increases. The others are rows, shape (m,), m ≥ 1: `place` is the index
    of the position that a row was computed from, and increases. The set-points are those in force, NaN if not given;
    `known` tells that those of velocity and acceleration are. `hover` is the hover thrust in force, NaN where it is not
    known. All set-points count in rows that are `flying`; the limits are the mode's, m/s, at least 0.
    """

    parameters: Parameters
    time_s: Samples
    z_m: Samples
    vz_m_s: Samples
    z_derivative_m_s: Samples
    place: NDArray[np.int64]
    flying: NDArray[np.bool_]
    set_z_m: Samples
    set_vz_m_s: Samples
    set_az_m_s2: Samples
    known: NDArray[np.bool_]
    limit_up_m_s: Samples
    limit_down_m_s: Samples
    hover: Samples
    out_vz_m_s: Samples
    out_az_m_s2: Samples
    out_thrust: Samples


def replica_of(log: LoopLog) -> dict[str, Samples]:
    """Signals as the replica computes them in flight, shape (m,) each; NaN where the log does not suffice."""
    return {
        "out_vz_m_s": _velocity_targets(log),
        "out_az_m_s2": _acceleration_targets(log),
        "out_thrust": _thrust(log),
    }


def _thrust(log: LoopLog) -> Samples:
    """Thrust of each row from its acceleration target."""
    thrust = log.hover * (1.0 - log.out_az_m_s2 / float(loop.GRAVITY))
    limited = np.clip(thrust, log.parameters.thrust_min, log.parameters.thrust_max)
    return np.where(log.flying, limited, np.nan)


def _velocity_targets(log: LoopLog) -> Samples:
    """Velocity target of each row from its position and set-points. In the ramp its limit was not logged."""
    targets = np.full(len(log.place), np.nan)
    climb, p = log.parameters.climb_m_s, log.parameters.position_p_1_s
    for row in np.flatnonzero(log.known & log.flying).tolist():
        error = log.set_z_m[row] - log.z_m[log.place[row]]
        target = loop.sum_of_given(np.float32(p * error), np.float32(log.set_vz_m_s[row]))
        up, down = min(log.limit_up_m_s[row], climb), log.limit_down_m_s[row]
        targets[row] = loop.limited_velocity(target, np.float32(up), np.float32(down))
    return targets


def _acceleration_targets(log: LoopLog) -> Samples:
    """Acceleration target of each row from that of the row before.

    NaN unless the set-points of both rows are known and the same, no limit is active at either, and every position
    between them was logged.
    """
    targets = np.full(len(log.place), np.nan)
    if len(log.place) < 2:
        return targets
    packed = loop.packed(log.parameters, float(np.median(np.diff(log.time_s))))
    inputs = _inputs(log)
    state = np.empty(loop.STATE_SIZE, dtype=np.float32)
    loop.start(state, packed)
    state[loop.TAKEOFF], state[loop.RAMP] = loop.FLIGHT, 1.0
    comparable = _comparable(log)
    begin = 0
    for row, place in enumerate(log.place.tolist()):
        run = inputs[begin : place + 1]
        if row:
            run[:, _SET_POINTS] = log.set_z_m[row - 1], log.set_vz_m_s[row - 1], log.set_az_m_s2[row - 1]
            run[:, _LIMITS] = log.limit_up_m_s[row - 1], log.limit_down_m_s[row - 1]
        run[-1, _HOVER] = log.hover[row]
        outputs = np.empty((len(run), len(loop.OUTPUTS)), dtype=np.float32)
        loop.rollout(state, packed, run, outputs)
        if comparable[row]:
            targets[row] = outputs[-1, loop.ACCELERATION_TARGET]
        _resume(state, log, row, dt_s=float(run[-1, 0]))
        begin = place + 1
    return targets


def _inputs(log: LoopLog) -> NDArray[np.float32]:
    """Inputs of the loop at every position, shape (n, 15) as `INPUTS`, without set-points."""
    inputs = np.zeros((len(log.time_s), len(loop.INPUTS)), dtype=np.float32)
    motion = (np.diff(log.time_s, prepend=log.time_s[0]), log.z_m, log.vz_m_s, log.z_derivative_m_s)
    inputs[:, : len(motion)] = np.column_stack(motion)
    inputs[:, [*_SET_POINTS, _HOVER]] = np.nan
    inputs[:, [loop.INPUTS.index("set_new"), loop.INPUTS.index("armed")]] = 1.0
    return inputs


def _comparable(log: LoopLog) -> NDArray[np.bool_]:
    """Rows whose acceleration target follows from the row before, shape (m,)."""
    least, most = log.parameters.thrust_min + _AT_LIMIT, log.parameters.thrust_max - _AT_LIMIT
    free = (log.out_thrust > least) & (log.out_thrust < most)
    sound = log.known & log.flying & free & np.isfinite(log.hover + log.out_vz_m_s + log.out_az_m_s2)
    set_points = np.column_stack([log.set_z_m, log.set_vz_m_s, log.set_az_m_s2])
    same = np.isclose(set_points[1:], set_points[:-1], rtol=0.0, atol=0.0, equal_nan=True).all(axis=1)
    interval_s = np.diff(log.time_s, prepend=log.time_s[0])
    complete = [
        interval_s[begin + 1 : end + 1].max() <= _LONGEST_INTERVAL_S
        for begin, end in zip(log.place[:-1], log.place[1:], strict=True)
    ]
    return np.append(False, sound[1:] & sound[:-1] & same & np.array(complete, dtype=np.bool_))


def _resume(state: loop.State, log: LoopLog, row: int, *, dt_s: float) -> None:
    """Set the integral such that it and the filters give the recorded acceleration target, and take its step.

    What is not known makes it NaN until the next row.
    """
    p = log.parameters
    error = log.out_vz_m_s[row] - float(state[loop.VELOCITY])
    given = 0.0 if math.isnan(log.set_az_m_s2[row]) else log.set_az_m_s2[row]
    integral = log.out_az_m_s2[row] - given - p.velocity_p_1_s * error + p.velocity_d * float(state[loop.DERIVATIVE])
    state[loop.INTEGRAL] = integral + p.velocity_i_1_s2 * error * dt_s
    state[loop.ACCELERATION_TARGET] = log.out_az_m_s2[row]
    state[loop.HOVER_THRUST] = log.hover[row]
