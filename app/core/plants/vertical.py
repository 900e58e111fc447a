"""The simple vertical model of a multicopter, and its takeoff under the autopilot's vertical loop.

Force, mass, gravity (the paper's eq. 7), with three refinements that are zero in the nominal model:

    z̈ = g·(thrust/hover − 1) − drag·ż,   thrust a first-order lag behind the command,

altitude z up from the ground at 0, explicit Euler at 512 Hz. The loop is entered a latency after the command, from rest
on the ground. Until then nothing moves, so a latency shifts the whole run in time, by any fraction of a step: the
outputs depend on it continuously, as a fit needs.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.fixed_point import measured
from app.core.control.vertical_loop import (
    ALT,
    FB_CMD,
    FF_CMD,
    FULL_THRUST,
    LARGEST_PRODUCT,
    LEVEL,
    POSITION_BITS,
    RATE_HZ,
    SPEED_BITS,
    STATE_SIZE,
    STEP_S,
    Z_REF,
    State,
    detect_flight,
    start,
    step,
)
from app.core.kernels import kernel
from app.core.trajectory import Samples

GRAVITY_M_S2: Final = 9.81

HOVER_THROTTLE: Final = 0
START_LATENCY_S: Final = 1
MOTOR_LAG_S: Final = 2
DRAG_1_S: Final = 3
"""Places in a model vector."""

CHANNELS: Final = ("altitude_m", "climb_rate_m_s", "reference_m", "thrust", "feed_forward", "feedback")

Counts = NDArray[np.int64]


@kernel
def _delay(signal: Samples, steps: float) -> None:
    """Shift a signal that was at rest at 0 before its first sample later by a fractional number of steps, in place."""
    whole = int(steps)
    part = steps - whole
    for i in range(len(signal) - 1, -1, -1):
        late = signal[i - whole] if i >= whole else 0.0
        later = signal[i - whole - 1] if i > whole else 0.0
        signal[i] = (1.0 - part) * late + part * later


@kernel
def _advance(altitude: float, climb: float, thrust: float, hover: float, drag: float) -> tuple[float, float]:
    """One explicit Euler step; the ground at 0 stops a descent."""
    acceleration = GRAVITY_M_S2 * (thrust / hover - 1.0) - drag * climb
    altitude += climb * STEP_S
    climb += acceleration * STEP_S
    if altitude <= 0.0:
        return 0.0, max(climb, 0.0)
    return altitude, climb


@kernel
def rollout(gains: Counts, model: Samples, target: int, state: State, altitude: Samples, detail: Samples) -> int:
    """Fly one takeoff to `target` (8 fractional bits) and return the largest |product| met in the loop.

    `gains` holds kp, ki, kd; `model` the four parameters. Writes `altitude`, shape (n,), every 1/512 s from the command
    on, and the other `CHANNELS` to `detail`, shape (5, n) or (5, 0) when they are not wanted. `state` is scratch.
    """
    kp, ki, kd = gains[0], gains[1], gains[2]
    hover, drag, lag = model[HOVER_THROTTLE], model[DRAG_1_S], model[MOTOR_LAG_S]
    response = STEP_S / lag if lag > STEP_S else 1.0
    height, climb, thrust, command = 0.0, 0.0, 0.0, 0
    wants_detail = detail.shape[1] > 0
    start(state, 0, 0)
    for i in range(len(altitude)):
        in_flight = detect_flight(state, command)
        command = step(
            state,
            ALT,
            target,
            kp,
            ki,
            kd,
            measured(-height, POSITION_BITS),
            measured(-climb, SPEED_BITS),
            LEVEL,
            in_flight,
        )
        altitude[i] = height
        if wants_detail:
            detail[0, i] = climb
            detail[1, i] = -state[Z_REF] / (1 << POSITION_BITS)
            detail[2, i] = command / FULL_THRUST
            detail[3, i] = state[FF_CMD] / FULL_THRUST
            detail[4, i] = state[FB_CMD] / FULL_THRUST
        thrust += response * (command / FULL_THRUST - thrust)
        height, climb = _advance(height, climb, thrust, hover, drag)
    if model[START_LATENCY_S] > 0.0:
        _delay(altitude, model[START_LATENCY_S] * RATE_HZ)
        for channel in range(detail.shape[0] if wants_detail else 0):
            _delay(detail[channel], model[START_LATENCY_S] * RATE_HZ)
    return int(state[LARGEST_PRODUCT])


@kernel
def rollouts(gains: Counts, models: Samples, target: int, state: State, altitude: Samples, no_detail: Samples) -> None:
    """Fly k takeoffs: gains (k, 3), models (k, 4), altitude out (k, n); `no_detail` has shape (5, 0)."""
    for run in range(len(gains)):
        rollout(gains[run], models[run], target, state, altitude[run], no_detail)


def fly(gains: Counts, model: Samples, target: int, samples: int) -> tuple[Samples, int]:
    """One takeoff with every channel: shape (6, samples) in the order of `CHANNELS`, and the largest |product|."""
    channels = np.empty((len(CHANNELS), samples))
    largest = rollout(gains, model, target, np.empty(STATE_SIZE, dtype=np.int64), channels[0], channels[1:])
    return channels, largest


def fly_batch(gains: Counts, models: Samples, target: int, samples: int) -> Samples:
    """Many takeoffs in one compiled call: gains (k, 3), models (k, 4) → altitude (k, samples)."""
    altitude = np.empty((len(gains), samples))
    no_detail = np.empty((len(CHANNELS) - 1, 0))
    rollouts(gains, models, target, np.empty(STATE_SIZE, dtype=np.int64), altitude, no_detail)
    return altitude
