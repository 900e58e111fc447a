"""Compiled inner loops of the simulated vehicles. All in one file: the kept machine code is judged by it."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.fixed_point import measured
from app.core.control.vertical_loop import (
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
    start,
    step,
)
from app.core.kernels import kernel
from app.core.plants.vertical import GRAVITY_M_S2

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
"""The autopilot's memory: the loop's state, whether the loop was entered, and the command of the step before."""

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
    """One step of the autopilot on what it senses, rounded to its integers; returns the thrust, a share of full.

    Until `may_enter` the motors rest and the loop is not entered. Writes the row's reference, thrust and its parts, and
    altitude and climb rate as sensed.
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


@kernel
def fly_simple_model(
    autopilot: Integers,
    command: Integers,
    plant: Rows,
    model: Rows,
    datum_m: float,
    gusts_m_s2: Rows,
    resting_steps: int,
    rows: Rows,
) -> None:
    """Advance the simple vertical model by as many steps as `rows` is long, writing a row before each.

    `plant` is altitude (m), climb rate (m/s) and thrust (share of full); `model` hover throttle, motor lag (s) and drag
    (1/s); explicit Euler at 512 Hz, the ground at 0. `gusts_m_s2` has the shape of the steps; the loop may be entered
    after the first `resting_steps` of them; altitude is sensed `datum_m` too high.
    """
    hover, lag, drag = model[0], model[1], model[2]
    response = STEP_S / lag if lag > STEP_S else 1.0
    height, climb, thrust = plant[0], plant[1], plant[2]
    for i in range(len(rows)):
        share = control(autopilot, command, height + datum_m, climb, 1.0, i >= resting_steps, rows[i])
        thrust += response * (share - thrust)
        acceleration = GRAVITY_M_S2 * (thrust / hover - 1.0) - drag * climb + gusts_m_s2[i]
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
