"""Compiled inner loops of the gate: takeoffs with aborts, and runs that drive products to where they wrap.

They share one file because numba validates its cached machine code by this file.
"""

from typing import Final

import numpy as np

from app.core.control.paparazzi import (
    ALT,
    CLIMB,
    FULL_THRUST,
    INT32_MAX,
    INT32_MIN,
    LEVEL,
    POSITION_BITS,
    POSITION_ERROR_MAX,
    RATE_HZ,
    SPEED_BITS,
    SPEED_ERROR_MAX,
    STEP_S,
    Z_REF,
    Z_SUM_ERR,
    ZD_REF,
    State,
    detect_flight,
    fix,
    limit,
    measured,
    start,
    step,
    wrap32,
)
from app.core.kernels import kernel
from app.core.models.vertical import (
    DRAG_1_S,
    HOVER_THROTTLE,
    MEASUREMENT_DELAY_S,
    MOTOR_LAG_S,
    QUADRATIC_SHARE,
    START_LATENCY_S,
    Counts,
    advance,
    sensed,
    thrust_to_weight,
)
from app.core.records.trajectory import Samples

HEIGHT: Final = 0
CLIMB_RATE: Final = 1
THRUST: Final = 2
COMMAND: Final = 3
STEPS_FLOWN: Final = 4
PLANT_SIZE: Final = 5
"""Indices in the vehicle's state array: m, m/s, share of full, counts, steps since the loop was entered."""

HIGHEST_M: Final = 0
HIGHEST_STEP: Final = 1
FALLEN_STEP: Final = 2
DISTANCE_MIDDLE_M: Final = 3
DISTANCE_LAST_M: Final = 4
SWING_MIDDLE_M_S: Final = 5
SWING_LAST_M_S: Final = 6
REPORT_SIZE: Final = 7
"""Indices in the report of a flight.

Fallen: the step at which it was back on the ground, or −1. Distances are from the set point, after the altitude first
exceeded half of it; swings are of the climb rate. Both are the largest in the middle and in the last third of the
flight.
"""

TOUCH_DOWN_M_S: Final = 1
"""Second entry of an abort's report, after the highest altitude: the touch-down speed, or 0."""

LOST_M: Final = 200.0
"""A flight above this altitude is not simulated any further."""

_DESCENT: Final = fix(-0.5, SPEED_BITS)
_STANDING_M: Final = 0.02
_TURN_M_S: Final = 0.02
"""Reversal of the climb rate that counts as a turning point."""


@kernel
def _no_past(model: Samples) -> Samples:
    """Buffer for the latest heights and climb rates, shape (2, d); d = 0 if the loop senses them without delay."""
    delay = model[MEASUREMENT_DELAY_S] * RATE_HZ
    return np.zeros((2, int(delay) + 2 if delay > 0.0 else 0))


@kernel
def fly_leg(
    state: State,
    plant: Samples,
    past: Samples,
    model: Samples,
    mode: int,
    target: int,
    gains: Counts,
    lands: bool,
    heights: Samples,
    climbs: Samples,
) -> int:
    """Continue a flight as `app.core.models.vertical.rollout` does.

    Writes height and climb rate before each step to `heights` and `climbs`, shape (n,). Stops early above `LOST_M`, or
    when a vehicle that `lands` has touched down. Returns the steps flown; `state`, `plant` and `past` then hold the
    values after them.
    """
    kp, ki, kd = gains[0], gains[1], gains[2]
    share, hover, lag, drag = model[QUADRATIC_SHARE], model[HOVER_THROTTLE], model[MOTOR_LAG_S], model[DRAG_1_S]
    hover_force = (1.0 - share) * hover + share * hover * hover
    response = STEP_S / lag if lag > STEP_S else 1.0
    delay, latency, size = model[MEASUREMENT_DELAY_S] * RATE_HZ, model[START_LATENCY_S], past.shape[1]
    height, climb, thrust = plant[HEIGHT], plant[CLIMB_RATE], plant[THRUST]
    command, first, flown = int(plant[COMMAND]), int(plant[STEPS_FLOWN]), 0
    for i in range(len(heights)):
        now = first + i
        sensed_height, sensed_climb = height, climb
        if size > 0:
            past[0, now % size], past[1, now % size] = height, climb
            sensed_height, sensed_climb = sensed(past[0], now, delay), sensed(past[1], now, delay)
        heights[i], climbs[i] = height, climb
        in_flight = detect_flight(state, command)
        z, zd = measured(-sensed_height, POSITION_BITS), measured(-sensed_climb, SPEED_BITS)
        command = step(state, mode, target, kp, ki, kd, z, zd, LEVEL, in_flight)
        thrust += response * (command / FULL_THRUST - thrust)
        lift = thrust_to_weight(thrust, height, now * STEP_S + latency, model, hover_force)
        height, climb = advance(height, climb, lift, drag)
        flown = i + 1
        if height > LOST_M or (lands and height <= 0.0):
            break
    plant[HEIGHT], plant[CLIMB_RATE], plant[THRUST] = height, climb, thrust
    plant[COMMAND], plant[STEPS_FLOWN] = command, first + flown
    return flown


@kernel
def _abort(
    state: State,
    plant: Samples,
    past: Samples,
    model: Samples,
    safe_gains: Counts,
    heights: Samples,
    climbs: Samples,
    report: Samples,
) -> None:
    """Simulate an abort: the safe gains, descending at 0.5 m/s until the vehicle stands, half a minute at most."""
    report[HIGHEST_M], report[TOUCH_DOWN_M_S] = plant[HEIGHT], 0.0
    if plant[HEIGHT] <= _STANDING_M:
        return
    flown = fly_leg(state, plant, past, model, CLIMB, _DESCENT, safe_gains, True, heights, climbs)
    report[HIGHEST_M] = max(plant[HEIGHT], heights[:flown].max())
    if plant[HEIGHT] <= 0.0:
        report[TOUCH_DOWN_M_S] = -climbs[flown - 1]


@kernel
def report_heights(heights: Samples, set_point: float, third: int, report: Samples) -> None:
    """Report the highest altitude, the return to the ground, and the distances from the set point.

    The flight may end before its three thirds are complete.
    """
    near = False
    for i in range(len(heights)):
        height = heights[i]
        if height > report[HIGHEST_M]:
            report[HIGHEST_M], report[HIGHEST_STEP] = height, i
        near = near or height >= 0.5 * set_point
        if near and height <= 0.0 and report[FALLEN_STEP] < 0.0:
            report[FALLEN_STEP] = i
        if near and i >= third:
            place = DISTANCE_MIDDLE_M if i < 2 * third else DISTANCE_LAST_M
            report[place] = max(report[place], abs(height - set_point))


@kernel
def report_swings(climbs: Samples, third: int, report: Samples) -> None:
    """Report the largest swings of the climb rate between turning points, by the third in which they end."""
    turn, extreme, extreme_step, way = 0.0, 0.0, 0, 1.0
    for i in range(len(climbs)):
        climb = climbs[i]
        if (climb - extreme) * way > 0.0:
            extreme, extreme_step = climb, i
        elif (extreme - climb) * way > _TURN_M_S:
            if extreme_step >= third:
                place = SWING_MIDDLE_M_S if extreme_step < 2 * third else SWING_LAST_M_S
                report[place] = max(report[place], abs(extreme - turn))
            turn, extreme, extreme_step, way = extreme, climb, i, -way


@kernel
def fly_with_aborts(
    gains: Counts,
    model: Samples,
    target: int,
    safe_gains: Counts,
    abort_steps: Counts,
    scratch: Counts,
    curves: Samples,
    report: Samples,
    aborts: Samples,
) -> None:
    """Simulate one takeoff, and the result of an abort at each of the increasing `abort_steps`, shape (a,).

    Writes `report`, shape (REPORT_SIZE,), and `aborts`, shape (a, 2). Steps count from the loop's entry. `scratch` has
    shape (2, STATE_SIZE), `curves` shape (4, n): its first two rows hold heights and climb rates of the n steps
    afterwards.
    """
    state, aborted = scratch[0], scratch[1]
    heights, climbs, steps = curves[0], curves[1], curves.shape[1]
    plant, past, flown = np.zeros(PLANT_SIZE), _no_past(model), 0
    report[:], aborts[:] = 0.0, 0.0
    report[FALLEN_STEP] = -1.0
    start(state, 0, 0)
    for following in range(len(abort_steps) + 1):
        until = min(abort_steps[following], steps) if following < len(abort_steps) else steps
        if until > flown:
            flown += fly_leg(
                state, plant, past, model, ALT, target, gains, False, heights[flown:until], climbs[flown:until]
            )
        if flown < until:
            break
        if following < len(abort_steps):
            aborted[:] = state
            _abort(aborted, plant.copy(), past.copy(), model, safe_gains, curves[2], curves[3], aborts[following])
    report_heights(heights[:flown], target / (1 << POSITION_BITS), steps // 3, report)
    report_swings(climbs[:flown], steps // 3, report)


@kernel
def fly_all_with_aborts(
    gains: Counts,
    models: Samples,
    target: int,
    safe_gains: Counts,
    abort_steps: Counts,
    scratch: Counts,
    curves: Samples,
    reports: Samples,
    aborts: Samples,
) -> None:
    """The same on k models, shape (k, m): abort steps (k, a), reports (k, REPORT_SIZE), aborts (k, a, 2)."""
    for run in range(len(models)):
        fly_with_aborts(
            gains, models[run], target, safe_gains, abort_steps[run], scratch, curves, reports[run], aborts[run]
        )


@kernel
def find_wraps(
    gains: Counts, model: Samples, target: int, frozen_step: int, steps: int, state: State, found: Counts
) -> None:
    """Take off, freeze height and climb rate at `frozen_step`, and find the products that wrap.

    The vehicle senses without delay here; `model` must say so. Writes step and product of the first wrap of each gain
    to `found`, shape (3, 2); step −1 if there is none.
    """
    plant, past = np.zeros(PLANT_SIZE), _no_past(model)
    heights, climbs, errors = np.zeros(1), np.zeros(1), np.zeros(3, dtype=np.int64)
    found[:, 0], found[:, 1] = -1, 0
    start(state, 0, 0)
    for i in range(steps):
        height, climb = plant[HEIGHT], plant[CLIMB_RATE]
        fly_leg(state, plant, past, model, ALT, target, gains, False, heights, climbs)
        z, zd = measured(-height, POSITION_BITS), measured(-climb, SPEED_BITS)
        if i >= frozen_step:
            plant[HEIGHT], plant[CLIMB_RATE] = height, climb
        errors[0] = limit(wrap32(state[Z_REF] - z), -POSITION_ERROR_MAX, POSITION_ERROR_MAX)
        errors[1] = state[Z_SUM_ERR]
        errors[2] = limit(wrap32(state[ZD_REF] - zd), -SPEED_ERROR_MAX, SPEED_ERROR_MAX)
        for place in range(3):
            product = -gains[place] * errors[place]
            if found[place, 0] < 0 and not INT32_MIN <= product <= INT32_MAX:
                found[place, 0], found[place, 1] = i, product
