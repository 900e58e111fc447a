"""Compiled inner loops of the simulated vehicles, all in one file because the cache of compiled code is keyed by it."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.paparazzi import (
    FB_CMD,
    FF_CMD,
    FULL_THRUST,
    POSITION_BITS,
    R33_BITS,
    RATE_HZ,
    SPEED_BITS,
    STATE_SIZE,
    STEP_S,
    Z_REF,
    detect_flight,
    measured,
    start,
    step,
)
from app.core.kernels import kernel
from app.core.models.vertical import GRAVITY_M_S2

Rows = NDArray[np.float64]
Integers = NDArray[np.int64]

ALTITUDE: Final = 0
CLIMB_RATE: Final = 1
SET_POINT: Final = 2
REFERENCE: Final = 3
THRUST: Final = 4
FEED_FORWARD: Final = 5
FEEDBACK: Final = 6
BATTERY: Final = 7
CHANNELS: Final = (
    "altitude_m",
    "climb_rate_m_s",
    "set_point_m",
    "reference_m",
    "thrust",
    "feed_forward",
    "feedback",
    "battery_v",
)
"""Columns of a record's rows."""

ENTERED: Final = STATE_SIZE
LAST_THRUST: Final = STATE_SIZE + 1
AUTOPILOT_SIZE: Final = STATE_SIZE + 2
"""The autopilot's memory: the loop's state, whether the loop was entered, and the thrust command of the previous
step."""

MODE: Final = 0
TARGET: Final = 1
KP: Final = 2
KI: Final = 3
KD: Final = 4
COMMAND_SIZE: Final = 5


@kernel
def control(
    autopilot: Integers,
    command: Integers,
    altitude_m: float,
    climb_m_s: float,
    cosine_of_tilt: float,
    may_enter: bool,
    row: Rows,
) -> float:
    """Run one step of the autopilot on its measurements, rounded to its integers; return thrust as a share of full.

    Until `may_enter` the motors are off and the loop is not entered. Writes the row's reference, thrust, feed-forward
    and feedback, and the altitude and climb rate as measured.
    """
    z, zd = measured(-altitude_m, POSITION_BITS), measured(-climb_m_s, SPEED_BITS)
    row[ALTITUDE], row[CLIMB_RATE] = altitude_m, climb_m_s
    if autopilot[ENTERED] == 0:
        if not may_enter:
            row[REFERENCE], row[THRUST], row[FEED_FORWARD], row[FEEDBACK] = altitude_m, 0.0, 0.0, 0.0
            return 0.0
        start(autopilot[:STATE_SIZE], z, zd)
        autopilot[ENTERED] = 1
    in_flight = detect_flight(autopilot, autopilot[LAST_THRUST])
    thrust = step(
        autopilot,
        command[MODE],
        command[TARGET],
        command[KP],
        command[KI],
        command[KD],
        z,
        zd,
        measured(cosine_of_tilt, R33_BITS),
        in_flight,
    )
    autopilot[LAST_THRUST] = thrust
    row[REFERENCE] = -autopilot[Z_REF] / (1 << POSITION_BITS)
    row[THRUST] = thrust / FULL_THRUST
    row[FEED_FORWARD] = autopilot[FF_CMD] / FULL_THRUST
    row[FEEDBACK] = autopilot[FB_CMD] / FULL_THRUST
    return thrust / FULL_THRUST


HOVER_SHARE: Final = 0
MOTOR_LAG_S: Final = 1
DRAG_1_S: Final = 2
QUADRATIC_SHARE: Final = 3
GROUND_EFFECT: Final = 4
GROUND_EFFECT_HEIGHT_M: Final = 5
MEASUREMENT_DELAY_S: Final = 6
SAG_1_S: Final = 7
MODEL_SIZE: Final = 8
"""Indices into the simple model's parameters."""

PAST: Final = 64
"""Steps of altitude and climb rate that are kept, a power of two; a delay of 0.1 s needs 51.2."""


@kernel
def fly_simple_model(
    autopilot: Integers,
    command: Integers,
    plant: Rows,
    past: Rows,
    model: Rows,
    datum_m: float,
    gusts_m_s2: Rows,
    resting_steps: int,
    first: int,
    rows: Rows,
) -> None:
    """Advance the simple vertical model by one step per row of `rows`, writing each row before its step.

    `plant` is altitude (m), climb rate (m/s) and thrust command after the lag (share of full); `past`, shape (2, 64),
    are the last altitudes and climb rates, for delayed measurement. A command u gives a lift of
    ((1 − q)·u + q·u²) / `HOVER_SHARE` of the weight, q the quadratic share, times 1 + e·exp(−altitude / height) near
    the ground, less `SAG_1_S` of it per second since the command. Explicit Euler at 512 Hz, the ground at 0.
    `gusts_m_s2` has shape (n,) as `rows`, and `first` is the number of the first step. The loop may be entered from
    step `resting_steps` on. The measured altitude is `datum_m` too high.
    """
    lag, drag, quadratic, ground_effect = (
        model[MOTOR_LAG_S],
        model[DRAG_1_S],
        model[QUADRATIC_SHARE],
        model[GROUND_EFFECT],
    )
    response = STEP_S / lag if lag > STEP_S else 1.0
    delay = model[MEASUREMENT_DELAY_S] * RATE_HZ
    whole = int(delay)
    part = delay - whole
    height, climb, thrust = plant[0], plant[1], plant[2]
    sensed_m, sensed_m_s = height, climb
    for i in range(len(rows)):
        if delay > 0.0:
            now = first + i
            past[0, now % PAST], past[1, now % PAST] = height, climb
            late, later = (now - whole) % PAST, (now - whole - 1) % PAST
            sensed_m = (1.0 - part) * past[0, late] + part * past[0, later]
            sensed_m_s = (1.0 - part) * past[1, late] + part * past[1, later]
        else:
            sensed_m, sensed_m_s = height, climb
        may_enter = first + i >= resting_steps
        share = control(autopilot, command, sensed_m + datum_m, sensed_m_s, 1.0, may_enter, rows[i])
        thrust += response * (share - thrust)
        lift = ((1.0 - quadratic) * thrust + quadratic * thrust * thrust) / model[HOVER_SHARE]
        if ground_effect > 0.0:
            lift *= 1.0 + ground_effect * np.exp(-height / model[GROUND_EFFECT_HEIGHT_M])
        lift *= 1.0 - model[SAG_1_S] * ((first + i) * STEP_S)
        acceleration = GRAVITY_M_S2 * (lift - 1.0) - drag * climb + gusts_m_s2[i]
        height += climb * STEP_S
        climb += acceleration * STEP_S
        if height <= 0.0:
            height, climb = 0.0, max(climb, 0.0)
    plant[0], plant[1], plant[2] = height, climb, thrust


@kernel
def correlate(white: Rows, correlation_s: float) -> None:
    """Turn unit white noise at 512 Hz, shape (n,), into a stationary first-order Gauss-Markov series of unit variance,
    in place."""
    kept = np.exp(-1.0 / (correlation_s * RATE_HZ))
    fresh = np.sqrt(1.0 - kept * kept)
    for i in range(1, len(white)):
        white[i] = kept * white[i - 1] + fresh * white[i]
