"""Compiled inner loops of the gate: flights with aborts, and runs that drive products to where they wrap.

They share one file because numba validates its cached machine code by this file.
"""

from typing import Final

import numpy as np

from app.core.control.vertical_guidance import (
    ALT,
    CLIMB,
    INT32_MAX,
    INT32_MIN,
    POSITION_BITS,
    POSITION_ERROR_MAX,
    SPEED_BITS,
    SPEED_ERROR_MAX,
    STATE_SIZE,
    Z_REF,
    Z_SUM_ERR,
    ZD_REF,
    State,
    fix,
    limit,
    measured,
    start,
    wrap32,
)
from app.core.kernels import kernel
from app.core.models.vertical import (
    ALTITUDE,
    CLIMB_RATE,
    VEHICLE_SIZE,
    Counts,
    fly_steps,
    new_past,
)
from app.core.records.trajectory import Samples

(
    HIGHEST_M, HIGHEST_STEP, FALLEN_STEP, DISTANCE_MIDDLE_M, DISTANCE_LAST_M, SWING_MIDDLE_M_S, SWING_LAST_M_S,
    REPORT_SIZE,
) = range(8)  # fmt: skip
"""Indices in the report of a flight.

Fallen: the step at which it was back on the ground, or −1. Distances are from the last set point, after the altitude
first exceeded half of the first; swings are of the climb rate. Both are the largest in the middle and in the last third
of the time at the last set point, which is the whole of a takeoff.
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
def _abort(
    state: State,
    vehicle: Samples,
    past: Samples,
    model: Samples,
    safe_gains: Counts,
    curves: Samples,
    report: Samples,
) -> None:
    """Simulate an abort: the safe gains, descending at 0.5 m/s until the vehicle stands, half a minute at most."""
    report[HIGHEST_M], report[TOUCH_DOWN_M_S] = vehicle[ALTITUDE], 0.0
    if vehicle[ALTITUDE] <= _STANDING_M:
        return
    descent = np.full(1, _DESCENT)
    flown = fly_steps(state, vehicle, past, model, CLIMB, descent, safe_gains, None, False, LOST_M, True, curves[:, 0:])
    report[HIGHEST_M] = max(vehicle[ALTITUDE], curves[ALTITUDE, :flown].max())
    if vehicle[ALTITUDE] <= 0.0:
        report[TOUCH_DOWN_M_S] = -curves[CLIMB_RATE, flown - 1]


@kernel
def report_heights(heights: Samples, near_m: float, set_point: float, first: int, third: int, report: Samples) -> None:
    """Report the highest altitude, the return to the ground after `near_m`, and the distances from the set point.

    The thirds begin at step `first`; the flight may end before they are complete.
    """
    near = False
    for i in range(len(heights)):
        height = heights[i]
        if height > report[HIGHEST_M]:
            report[HIGHEST_M], report[HIGHEST_STEP] = height, i
        near = near or height >= near_m
        if near and height <= 0.0 and report[FALLEN_STEP] < 0.0:
            report[FALLEN_STEP] = i
        if near and i >= first + third:
            place = DISTANCE_MIDDLE_M if i < first + 2 * third else DISTANCE_LAST_M
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
    targets: Counts,
    safe_gains: Counts,
    abort_steps: Counts,
    curves: Samples,
    report: Samples,
    aborts: Samples,
) -> None:
    """Simulate one flight, and the result of an abort at each of the increasing `abort_steps`, shape (a,).

    Writes `report`, shape (REPORT_SIZE,), and `aborts`, shape (a, 2). Steps count from the loop's entry. `curves` is
    scratch of shape (2, 2, n) for altitude and climb rate of n steps, of the flight and of an abort.
    """
    state, aborted = np.zeros(STATE_SIZE, dtype=np.int64), np.zeros(STATE_SIZE, dtype=np.int64)
    curve, steps = curves[0], curves.shape[2]
    vehicle, past, flown = np.zeros(VEHICLE_SIZE), new_past(model), 0
    report[:], aborts[:] = 0.0, 0.0
    report[FALLEN_STEP] = -1.0
    start(state, 0, 0)
    for following in range(len(abort_steps) + 1):
        until = min(abort_steps[following], steps) if following < len(abort_steps) else steps
        if until > flown:
            leg = curve[:, flown:until]
            flown += fly_steps(state, vehicle, past, model, ALT, targets, gains, None, False, LOST_M, False, leg)
        if flown < until:
            break
        if following < len(abort_steps):
            aborted[:] = state
            _abort(aborted, vehicle.copy(), past.copy(), model, safe_gains, curves[1], aborts[following])
    last_change = len(targets) - 1
    third = (steps - last_change) // 3
    half, set_point = 0.5 * targets[0] / (1 << POSITION_BITS), targets[-1] / (1 << POSITION_BITS)
    report_heights(curve[ALTITUDE, :flown], half, set_point, last_change, third, report)
    report_swings(curve[CLIMB_RATE, last_change:flown], third, report)


@kernel
def find_wraps(gains: Counts, model: Samples, targets: Counts, frozen_step: int, steps: int, found: Counts) -> None:
    """Take off, freeze altitude and climb rate at `frozen_step`, and find the products that wrap.

    The vehicle senses without delay here; `model` must say so. Writes step and product of the first wrap of each gain
    to `found`, shape (3, 2); step −1 if there is none.
    """
    state, vehicle, past = np.zeros(STATE_SIZE, dtype=np.int64), np.zeros(VEHICLE_SIZE), new_past(model)
    curve, errors = np.zeros((2, 1))[:, 0:], np.zeros(3, dtype=np.int64)
    found[:, 0], found[:, 1] = -1, 0
    start(state, 0, 0)
    for i in range(steps):
        fly_steps(state, vehicle, past, model, ALT, targets, gains, None, False, LOST_M, False, curve)
        altitude, climb = curve[ALTITUDE, 0], curve[CLIMB_RATE, 0]
        z, zd = measured(-altitude, POSITION_BITS), measured(-climb, SPEED_BITS)
        if i >= frozen_step:
            vehicle[ALTITUDE], vehicle[CLIMB_RATE] = altitude, climb
        errors[0] = limit(wrap32(state[Z_REF] - z), -POSITION_ERROR_MAX, POSITION_ERROR_MAX)
        errors[1] = state[Z_SUM_ERR]
        errors[2] = limit(wrap32(state[ZD_REF] - zd), -SPEED_ERROR_MAX, SPEED_ERROR_MAX)
        for place in range(3):
            product = -gains[place] * errors[place]
            if found[place, 0] < 0 and not INT32_MIN <= product <= INT32_MAX:
                found[place, 0], found[place, 1] = i, product
