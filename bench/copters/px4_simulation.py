"""Flights of altitude changes: the replica of PX4's loop around a vehicle that differs from the model of the analysis.

The vehicle moves in steps of 4 ms, the loop runs in every second of them. Its estimator's climb rate and altitude
wander, the first within seconds, as PX4's does. The altitude changes are those of an auto mode, limited in jerk, or the
steps that offboard control sends.
"""

from dataclasses import replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.experiments import SLOW_HZ, Px4Loop
from app.autopilots.px4.replica import vertical as loop
from app.autopilots.px4.replica.parameters import STEP_S, Parameters, low_pass_gain
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.kernels import kernel
from app.core.models.copter import filtered
from app.core.records.trajectory import Samples
from bench.copters.simulation import SimulatedCopter, StepFlight, move, packed, sample, weather_of

_MOVES: Final = 2
_MOVE_S: Final = STEP_S / _MOVES
_ROW_EVERY: Final = 12
SETTLE_S: Final = 4.0
_CHANGES_M: Final = (2.0, -2.0, 2.0, -2.0)
_CHANGE_LASTS_S: Final = 5.0
HEIGHT_M: Final = 5.0
_JERK_M_S3: Final = 3.0
_SET_POINTS_EVERY_S: Final = 0.02
_STEPS: Final = round((SETTLE_S + _CHANGE_LASTS_S * len(_CHANGES_M)) / STEP_S)
_SCORED_FROM: Final = round(SETTLE_S / STEP_S)

_CLIMB_RATE_WANDER_S: Final = 0.6

Manoeuvre = Literal["auto", "offboard"]


def sample_px4(random: np.random.Generator) -> SimulatedCopter:
    """Draw a vehicle with PX4's estimator, whose climb rate wanders more than ArduCopter's."""
    return replace(sample(random), wander_m_s=float(random.uniform(0.01, 0.08)))


def loop_of(parameters: Parameters) -> Px4Loop:
    """The loop of every flight, with these parameters."""
    return Px4Loop(parameters=parameters, step_s=STEP_S, row_s=_ROW_EVERY * STEP_S, descent_m_s=parameters.descent_m_s)


def fly_changes(
    copter: SimulatedCopter, parameters: Parameters, *, seed: int, manoeuvre: Manoeuvre = "auto"
) -> StepFlight:
    """Hover at 5 m, climb and descend twice by 2 m, or by 1 m in steps, in the weather of `seed`."""
    estimate = _estimate(copter, parameters)
    reference = _reference(manoeuvre)
    weather = weather_of(copter, seed, _MOVES * _STEPS, _MOVE_S, climb_rate_wander_s=_CLIMB_RATE_WANDER_S)
    flown, still = (_flown(copter, parameters, estimate, each, reference) for each in (weather, np.zeros_like(weather)))
    z, v, v_t, thrust = flown.T
    slow_gain = low_pass_gain(SLOW_HZ, STEP_S)
    moved = thrust - still[:, 3]
    slow = filtered(moved, (np.array([slow_gain]), np.array([1.0, slow_gain - 1.0])))
    rows = slice(None, None, _ROW_EVERY)
    changes = np.diff(v[rows]) / (_ROW_EVERY * STEP_S)
    segment = Segment(
        time_s=np.asarray(STEP_S * np.arange(0, _STEPS, _ROW_EVERY), dtype=np.float64),
        z_m=z[rows],
        v_m_s=v[rows],
        a_m_s2=np.append(changes[0], changes),
        z_d_m=reference[rows, 0],
        v_d_m_s=reference[rows, 1],
        a_d_m_s2=reference[rows, 2],
        v_t_m_s=v_t[rows],
        throttle=thrust[rows],
        throttle_filtered=thrust[rows],
        assumed_hover=np.full(len(z[rows]), estimate),
    )
    return StepFlight(
        error_m=float(np.abs(reference[_SCORED_FROM:, 0] - z[_SCORED_FROM:]).mean()),
        activity=float(np.std((moved - slow)[_SCORED_FROM:])),
        log=LoggedFlight(loop=loop_of(parameters), segments=[segment]),
    )


def fly_reference(copter: SimulatedCopter, parameters: Parameters, reference: Samples, *, seed: int) -> Samples:
    """Fly along this reference, shape (n, 3), from hover at its first altitude: altitude, climb rate, climb rate target
    and thrust at each step, shape (n, 4)."""
    weather = weather_of(copter, seed, _MOVES * len(reference), _MOVE_S, climb_rate_wander_s=_CLIMB_RATE_WANDER_S)
    return _flown(copter, parameters, _estimate(copter, parameters), weather, reference)


def _estimate(copter: SimulatedCopter, parameters: Parameters) -> float:
    """The hover throttle that PX4's estimator finds."""
    return float(np.clip(copter.hover_throttle, parameters.hover_thrust - 0.2, parameters.hover_thrust + 0.2))


def _flown(
    copter: SimulatedCopter, parameters: Parameters, estimate: float, weather: Samples, reference: Samples
) -> Samples:
    """Altitude, climb rate, climb rate target and thrust at each step, shape (n, 4)."""
    p, flown = loop.packed(parameters), np.empty((len(reference), 4))
    state = np.empty(loop.STATE_SIZE, dtype=np.float32)
    loop.start_hover(state, p, estimate, copter.hover_throttle, 0.0)
    inputs, outputs = np.zeros((1, len(loop.INPUTS)), np.float32), np.empty((1, len(loop.OUTPUTS)), np.float32)
    for name, value in {
        "dt_s": STEP_S, "set_new": 1.0, "hover_estimate": estimate, "armed": 1.0,
        "limit_up_m_s": parameters.climb_m_s, "limit_down_m_s": parameters.descent_m_s,
    }.items():  # fmt: skip
        inputs[0, loop.INPUTS.index(name)] = value
    _fly(state, p, packed(copter, _MOVE_S), weather, reference, inputs, outputs, _MOVE_S, flown)
    return flown


def _reference(manoeuvre: Manoeuvre) -> Samples:
    """Altitude, climb rate and acceleration at each step, shape (n, 3)."""
    reference = np.zeros((_STEPS, 3))
    reference[:, 0] = HEIGHT_M
    time_s = STEP_S * np.arange(_STEPS)
    for number, change_m in enumerate(_CHANGES_M):
        since_s = time_s - SETTLE_S - number * _CHANGE_LASTS_S
        if manoeuvre == "offboard":
            reference[:, 0] += np.where(since_s >= 0.0, 0.5 * change_m, 0.0)
        else:
            reference += change_m * _smooth(np.floor(since_s / _SET_POINTS_EVERY_S) * _SET_POINTS_EVERY_S, change_m)
    return reference


def _smooth(since_s: Samples, change_m: float) -> Samples:
    """A change of 1 as fast as the jerk allows for `change_m`, and its first two derivatives, shape (n, 3)."""
    jerk = _JERK_M_S3 / abs(change_m)
    quarter_s = (0.5 / jerk) ** (1.0 / 3.0)
    t = np.clip(since_s, 0.0, 4.0 * quarter_s)
    z, v, a = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for begin, sign in ((0.0, 1.0), (1.0, -2.0), (3.0, 2.0)):
        after = np.maximum(t - begin * quarter_s, 0.0)
        z += sign * jerk * after**3 / 6.0
        v += sign * jerk * after**2 / 2.0
        a += sign * jerk * after
    return np.column_stack([z, v, a])


@kernel
def _fly(
    state: loop.State,
    p: loop.Packed,
    copter: Samples,
    weather: Samples,
    reference: Samples,
    inputs: NDArray[np.float32],
    outputs: NDArray[np.float32],
    move_s: float,
    flown: Samples,
) -> None:
    moving = np.array([copter[0], reference[0, 0], 0.0])
    late, per_step = int(copter[6]), len(weather) // len(reference)
    for row in range(len(reference)):
        now = per_step * row
        flown[row, 0], flown[row, 1] = moving[1] + weather[now, 3], moving[2] + weather[now, 2]
        inputs[0, 1], inputs[0, 2] = -flown[row, 0], -flown[row, 1]
        inputs[0, 4], inputs[0, 5], inputs[0, 6] = -reference[row, 0], -reference[row, 1], -reference[row, 2]
        loop.rollout(state, p, inputs, outputs)
        flown[row, 2], flown[row, 3] = -state[loop.VELOCITY_TARGET], state[loop.THRUST]
        for part in range(per_step):
            sent = (now + part - late) // per_step
            command = flown[sent, 3] if sent >= 0 else copter[0]
            move(moving, copter, command, (now + part) * move_s, weather[now + part, 0], move_s)
