"""Takeoff of the simple vertical model with the disturbances of a recorded flight added inside the control loop.

The paper's step 4 (Abbeel et al. 2006): f(s, a) + s_{t+1} − f(s_t, a_t), indexed by time; s is altitude and climb rate,
a the thrust command, whose lagged value follows from the commands. The loop is entered at the first thrust of the
recorded flight.
"""

from typing import Final

import numpy as np

from app.core.control.fixed_point import measured
from app.core.control.vertical_loop import (
    ALT,
    FULL_THRUST,
    LEVEL,
    POSITION_BITS,
    SPEED_BITS,
    STATE_SIZE,
    STEP_S,
    State,
    detect_flight,
    start,
    step,
)
from app.core.kernels import kernel
from app.core.plants.vertical import (
    DRAG_1_S,
    HOVER_THROTTLE,
    MOTOR_LAG_S,
    QUADRATIC_SHARE,
    Counts,
    advance,
    thrust_to_weight,
)
from app.core.trajectory import Samples

ALTITUDE: Final = 0
CLIMB_RATE: Final = 1
ENTERED: Final = 2
COLUMNS: Final = 3
"""Columns of the disturbances: of altitude (m) and climb rate (m/s) in the next step, and whether the loop is
entered."""

_NEVER: Final = 1 << 30


@kernel
def _hover_force(model: Samples) -> float:
    share, hover = model[QUADRATIC_SHARE], model[HOVER_THROTTLE]
    force: float = (1.0 - share) * hover + share * hover * hover
    return force


@kernel
def _observe(altitude: Samples, climb: Samples, thrust: Samples, model: Samples, found: Samples) -> None:
    hover_force, lag = _hover_force(model), model[MOTOR_LAG_S]
    response = STEP_S / lag if lag > STEP_S else 1.0
    lagged, entered = 0.0, 0.0
    for i in range(len(altitude)):
        if thrust[i] > 0.0:
            entered = 1.0
        found[i, ENTERED] = entered
        if i + 1 == len(altitude):
            break
        lagged += response * (thrust[i] - lagged)
        lift = thrust_to_weight(lagged, altitude[i], i * STEP_S, model, hover_force)
        height, speed = advance(altitude[i], climb[i], lift, model[DRAG_1_S])
        found[i, ALTITUDE], found[i, CLIMB_RATE] = altitude[i + 1] - height, climb[i + 1] - speed


@kernel
def _rollout(gains: Counts, model: Samples, target: int, state: State, added: Samples, altitude: Samples) -> None:
    hover_force, lag = _hover_force(model), model[MOTOR_LAG_S]
    response = STEP_S / lag if lag > STEP_S else 1.0
    height, climb, thrust, command = 0.0, 0.0, 0.0, 0
    entered_at = _NEVER
    for i in range(len(altitude)):
        z, zd = measured(-height, POSITION_BITS), measured(-climb, SPEED_BITS)
        if entered_at == _NEVER and added[i, ENTERED] > 0.0:
            start(state, z, zd)
            entered_at = i
        if i >= entered_at:
            in_flight = detect_flight(state, command)
            command = step(state, ALT, target, gains[0], gains[1], gains[2], z, zd, LEVEL, in_flight)
        altitude[i] = height
        thrust += response * (command / FULL_THRUST - thrust)
        lift = thrust_to_weight(thrust, height, i * STEP_S, model, hover_force)
        height, climb = advance(height, climb, lift, model[DRAG_1_S])
        height += added[i, ALTITUDE]
        climb += added[i, CLIMB_RATE]


@kernel
def _rollouts(gains: Counts, models: Samples, target: int, state: State, added: Samples, altitude: Samples) -> None:
    for run in range(len(gains)):
        _rollout(gains[run], models[run], target, state, added, altitude[run])


def observe(altitude_m: Samples, climb_rate_m_s: Samples, thrust: Samples, model: Samples) -> Samples:
    """Disturbances of a flight recorded at 512 Hz, channels of shape (n,): (n, 3), see `COLUMNS`.

    The model's latency and measurement delay are ignored: the recorded values are taken as the state.
    """
    found = np.zeros((len(altitude_m), COLUMNS))
    _observe(altitude_m, climb_rate_m_s, thrust, model, found)
    return found


def fly_batch(gains: Counts, models: Samples, target: int, disturbances: Samples) -> Samples:
    """Many disturbed takeoffs in one call: gains (k, 3), models (k, 8), disturbances (n, 3) → altitude (k, n)."""
    altitude = np.empty((len(gains), len(disturbances)))
    _rollouts(gains, models, target, np.empty(STATE_SIZE, dtype=np.int64), disturbances, altitude)
    return altitude
