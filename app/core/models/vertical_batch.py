"""Simultaneous flights of the simple vertical model: bit for bit as `vertical.rollout`, in a third of the time.

All runs take a step before the next step begins, so that the inner loops run over the lanes and can be vectorised. Two
properties make this possible. The loop's reference and feed-forward depend on the set points alone, and come from a
table. And its integers are stored as doubles, whose arithmetic is exact for them as long as nothing wraps at 32 bits:
`are_exact` selects the gains with which no product can wrap, and the climb rate would have to reach 4096 m/s, which no
model within its bounds does.
"""

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.vertical_guidance import (
    ALT,
    CHECK_PHASE,
    ERROR_SUM_MAX,
    FF_CMD,
    FULL_THRUST,
    INT32_MAX,
    LEVEL,
    POSITION_BITS,
    POSITION_ERROR_MAX,
    RATE_HZ,
    SPEED_BITS,
    SPEED_ERROR_MAX,
    STATE_SIZE,
    STEP_S,
    Z_REF,
    ZD_REF,
    detect_flight,
    start,
    step,
)
from app.core.kernels import kernel
from app.core.models.set_points import SetPoints
from app.core.models.vertical import (
    BATTERY_SAG,
    DRAG_1_S,
    GRAVITY_M_S2,
    GROUND_EFFECT,
    GROUND_EFFECT_HEIGHT_M,
    HOVER_THROTTLE,
    MEASUREMENT_DELAY_S,
    MOTOR_LAG_S,
    QUADRATIC_SHARE,
    START_LATENCY_S,
    Counts,
    advance,
    delay_start,
    fly_each,
    force_at_hover,
    lift_of,
    response_of,
)
from app.core.records.trajectory import Samples

BATCH_WIDTH: Final = 16
"""Largest number of simultaneous runs."""
PAST: Final = 64
"""Length of the altitude and climb rate buffers, in steps: a power of two."""

_POSITION, _SPEED, _FEED_FORWARD, _CHECK, _GUIDE_SIZE = range(5)
"""Rows of the table shared by all runs: reference position and speed, feed-forward, whether flight is checked."""

(
    _KP, _KI, _KD, _SHARE, _HOVER_FORCE, _RESPONSE, _GROUND, _SAG, _LATENCY, _DRAG, _PART, _HEIGHT, _CLIMB, _THRUST,
    _ERROR_SUM, _COMMAND, _IN_FLIGHT, _HEIGHT_BEFORE, _CLIMB_BEFORE, _SENSED, _SIZE,
) = range(0, 21 * BATCH_WIDTH, BATCH_WIDTH)  # fmt: skip
"""Offsets of each quantity in the array of the runs.

One array with fixed offsets lets the compiler see that the quantities of different runs do not overlap. The gains are
negative, and scaled as the loop shifts their products. `_BEFORE` holds height and climb rate one step earlier, delayed
by whole steps only.
"""

_POSITION_UNIT: Final = float(1 << POSITION_BITS)
_SPEED_UNIT: Final = float(1 << SPEED_BITS)
_LARGEST_POSITION: Final = float(POSITION_ERROR_MAX)
_LARGEST_SPEED: Final = float(SPEED_ERROR_MAX)
_LARGEST_SUM: Final = float(ERROR_SUM_MAX)


def are_exact(gains: Counts) -> NDArray[np.bool_]:
    """Which gain sets have products that cannot wrap: (k, 3) → (k,)."""
    largest = np.abs(gains) * np.array([POSITION_ERROR_MAX, ERROR_SUM_MAX, SPEED_ERROR_MAX])
    return np.asarray((largest <= INT32_MAX).all(axis=1))


def fly_batch(gains: Counts, models: Samples, set_points: SetPoints, samples: int) -> Samples:
    """Many flights in compiled calls: gains (k, 3), models (k, 8) → altitude (k, samples)."""
    altitude = np.empty((len(gains), samples))
    exact = are_exact(gains) & (models[:, MEASUREMENT_DELAY_S] * RATE_HZ < PAST - 2)
    side_by_side, alone = np.flatnonzero(exact), np.flatnonzero(~exact)
    guide = _guide(set_points, samples)
    for first in range(0, len(side_by_side), BATCH_WIDTH):
        runs = side_by_side[first : first + BATCH_WIDTH]
        flown = np.empty((len(runs), samples))
        _fly_lanes(gains[runs], models[runs], set_points.targets, guide, flown)
        altitude[runs] = flown
    altitude[alone] = fly_each(gains[alone], models[alone], set_points, samples)
    return altitude


def reference_altitude(set_points: SetPoints, samples: int) -> Samples:
    """The loop's reference, m up, in every step of a flight that starts with the command, shape (samples,)."""
    return np.asarray(-_guide(set_points, samples)[_POSITION] / _POSITION_UNIT)


@lru_cache(maxsize=16)
def _guide(set_points: SetPoints, samples: int) -> Samples:
    """The part of the loop that does not depend on what is sensed, for every step, shape (4, n)."""
    return _guide_to(set_points.targets, samples)


@kernel
def _guide_to(targets: Counts, samples: int) -> Samples:
    guide, state = np.empty((_GUIDE_SIZE, samples)), np.zeros(STATE_SIZE, dtype=np.int64)
    start(state, 0, 0)
    for i in range(samples):
        guide[_CHECK, i] = 1.0 if state[CHECK_PHASE] >= RATE_HZ else 0.0
        in_flight = detect_flight(state, 0)
        step(state, ALT, targets[min(i, len(targets) - 1)], 0, 0, 0, 0, 0, LEVEL, in_flight)
        guide[_POSITION, i], guide[_SPEED, i], guide[_FEED_FORWARD, i] = state[Z_REF], state[ZD_REF], state[FF_CMD]
    return guide


@kernel
def _set_up(gains: Counts, models: Samples, runs: Samples, whole: Counts) -> None:
    for lane in range(len(gains)):
        model = models[lane]
        delay = model[MEASUREMENT_DELAY_S] * RATE_HZ
        runs[_KP + lane] = -gains[lane, 0] / (1 << 7)
        runs[_KI + lane] = -gains[lane, 1] / (1 << 16)
        runs[_KD + lane] = -gains[lane, 2] / (1 << 16)
        runs[_SHARE + lane] = model[QUADRATIC_SHARE]
        runs[_HOVER_FORCE + lane] = force_at_hover(model[HOVER_THROTTLE], model[QUADRATIC_SHARE])
        runs[_RESPONSE + lane] = response_of(model[MOTOR_LAG_S])
        runs[_GROUND + lane] = model[GROUND_EFFECT]
        runs[_SAG + lane] = model[BATTERY_SAG]
        runs[_LATENCY + lane] = model[START_LATENCY_S]
        runs[_DRAG + lane] = model[DRAG_1_S]
        whole[lane] = int(delay)
        runs[_PART + lane] = delay - whole[lane]


@kernel
def _take_step(runs: Samples, lanes: int, heights: Samples, climbs: Samples, guide: Samples, i: int) -> None:
    """Step i of the loop and of the model for each run: `control.vertical_guidance.step` in doubles, then `advance`."""
    now, seconds = (i & (PAST - 1)) * BATCH_WIDTH, i * STEP_S
    position, speed, feed_forward = guide[_POSITION, i], guide[_SPEED, i], guide[_FEED_FORWARD, i]
    for lane in range(lanes):
        part, late, late_climb = runs[_PART + lane], heights[now + lane], climbs[now + lane]
        sensed = (1.0 - part) * late + part * runs[_HEIGHT_BEFORE + lane]
        sensed_climb = (1.0 - part) * late_climb + part * runs[_CLIMB_BEFORE + lane]
        runs[_HEIGHT_BEFORE + lane], runs[_CLIMB_BEFORE + lane], runs[_SENSED + lane] = late, late_climb, sensed
        ez = position - np.floor(-sensed * _POSITION_UNIT + 0.5)
        ev = speed - np.floor(-sensed_climb * _SPEED_UNIT + 0.5)
        ez = min(max(ez, -_LARGEST_POSITION), _LARGEST_POSITION)
        ev = min(max(ev, -_LARGEST_SPEED), _LARGEST_SPEED)
        total = min(max(runs[_ERROR_SUM + lane] + ez, -_LARGEST_SUM), _LARGEST_SUM) * runs[_IN_FLIGHT + lane]
        feedback = (
            np.floor(runs[_KP + lane] * ez) + np.floor(runs[_KD + lane] * ev) + np.floor(runs[_KI + lane] * total)
        )
        command = min(max(feed_forward + feedback, 0.0), float(FULL_THRUST))
        thrust = runs[_THRUST + lane]
        thrust += runs[_RESPONSE + lane] * (command / FULL_THRUST - thrust)
        height, climb = runs[_HEIGHT + lane], runs[_CLIMB + lane]
        lift = lift_of(
            thrust,
            height,
            seconds + runs[_LATENCY + lane],
            runs[_SHARE + lane],
            runs[_GROUND + lane],
            GROUND_EFFECT_HEIGHT_M,
            runs[_SAG + lane],
            runs[_HOVER_FORCE + lane],
        )
        height, climb = advance(height, climb, GRAVITY_M_S2 * (lift - 1.0) - runs[_DRAG + lane] * climb)
        runs[_ERROR_SUM + lane], runs[_COMMAND + lane], runs[_THRUST + lane] = total, command, thrust
        runs[_HEIGHT + lane], runs[_CLIMB + lane] = height, climb


@kernel
def _fly_lanes(gains: Counts, models: Samples, targets: Counts, guide: Samples, altitude: Samples) -> None:
    """Fly up to `BATCH_WIDTH` runs: gains (k, 3), models (k, 8), altitude out (k, n).

    Delayed values are written ahead to where they are due, so that all runs read at the same index.
    """
    lanes = len(gains)
    runs, whole = np.zeros(_SIZE), np.zeros(BATCH_WIDTH, dtype=np.int64)
    heights, climbs = np.zeros(PAST * BATCH_WIDTH), np.zeros(PAST * BATCH_WIDTH)
    states = np.zeros((BATCH_WIDTH, STATE_SIZE), dtype=np.int64)
    _set_up(gains, models, runs, whole)
    for i in range(guide.shape[1]):
        for lane in range(lanes):
            due = ((i + whole[lane]) & (PAST - 1)) * BATCH_WIDTH + lane
            heights[due], climbs[due] = runs[_HEIGHT + lane], runs[_CLIMB + lane]
        if guide[_CHECK, i] > 0.0:
            for lane in range(lanes):
                states[lane, CHECK_PHASE] = RATE_HZ
                runs[_IN_FLIGHT + lane] = 1.0 if detect_flight(states[lane], int(runs[_COMMAND + lane])) else 0.0
        _take_step(runs, lanes, heights, climbs, guide, i)
        for lane in range(lanes):
            altitude[lane, i] = runs[_SENSED + lane]
    for lane in range(lanes):
        if runs[_LATENCY + lane] > 0.0:
            delay_start(altitude[lane], targets, runs[_LATENCY + lane])
