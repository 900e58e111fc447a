"""Compiled inner loops of the simulated vehicles, all in one file because the cache of compiled code is keyed by it."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.vertical_guidance import (
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
from app.core.models.vertical import (
    BATTERY_SAG,
    DRAG_1_S,
    GRAVITY_M_S2,
    GROUND_EFFECT,
    MEASUREMENT_DELAY_S,
    MOTOR_LAG_S,
    QUADRATIC_SHARE,
    advance,
    lift_of,
    response_of,
    sensed,
)

Rows = NDArray[np.float64]
Integers = NDArray[np.int64]

ALTITUDE, CLIMB_RATE, SET_POINT, REFERENCE, THRUST, FEED_FORWARD, FEEDBACK, BATTERY = range(8)
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

MODE, TARGET, KP, KI, KD, COMMAND_SIZE = range(6)


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


PAST: Final = 64
"""Steps of altitude and climb rate that are kept; a delay of 0.1 s needs 51.2."""


@kernel
def fly_simple_model(
    autopilot: Integers,
    command: Integers,
    plant: Rows,
    past: Rows,
    model: Rows,
    hover_force: float,
    ground_effect_height_m: float,
    datum_m: float,
    gusts_m_s2: Rows,
    resting_steps: int,
    first: int,
    rows: Rows,
) -> None:
    """Advance the simple model of app.core.models.vertical by a step per row of `rows`, writing each before its step.

    `plant` is altitude (m), climb rate (m/s) and thrust command after the lag (share of full); `past`, shape (2, 64),
    are the last altitudes and climb rates, for delayed measurement. `hover_force`, a share of full force, replaces that
    at the model's hover throttle. `gusts_m_s2` has shape (n,) as `rows`, and `first` is the number of the first step.
    The loop may be entered from step `resting_steps` on. The measured altitude is `datum_m` too high.
    """
    response, delay = response_of(model[MOTOR_LAG_S]), model[MEASUREMENT_DELAY_S] * RATE_HZ
    height, climb, thrust = plant[0], plant[1], plant[2]
    for i in range(len(rows)):
        now = first + i
        sensed_m, sensed_m_s = height, climb
        if delay > 0.0:
            past[0, now % PAST], past[1, now % PAST] = height, climb
            sensed_m, sensed_m_s = sensed(past[0], now, delay), sensed(past[1], now, delay)
        share = control(autopilot, command, sensed_m + datum_m, sensed_m_s, 1.0, now >= resting_steps, rows[i])
        thrust += response * (share - thrust)
        lift = lift_of(
            thrust,
            height,
            now * STEP_S,
            model[QUADRATIC_SHARE],
            model[GROUND_EFFECT],
            ground_effect_height_m,
            model[BATTERY_SAG],
            hover_force,
        )
        height, climb = advance(height, climb, GRAVITY_M_S2 * (lift - 1.0) - model[DRAG_1_S] * climb + gusts_m_s2[i])
    plant[0], plant[1], plant[2] = height, climb, thrust


@kernel
def correlate(white: Rows, correlation_s: float) -> None:
    """Turn unit white noise at 512 Hz, shape (n,), into a stationary first-order Gauss-Markov series of unit variance,
    in place."""
    kept = np.exp(-1.0 / (correlation_s * RATE_HZ))
    fresh = np.sqrt(1.0 - kept * kept)
    for i in range(1, len(white)):
        white[i] = kept * white[i - 1] + fresh * white[i]
