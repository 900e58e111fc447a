"""The copter under ArduCopter's vertical loop, along a given reference, and the reference that the loop shapes."""

import numpy as np

from app.autopilots.ardupilot.replica.vertical import (
    A_D,
    DT,
    STATE_SIZE,
    THROTTLE,
    THROTTLE_FILTERED,
    THROTTLE_GAIN,
    V_D,
    Z_D,
    Packed,
    State,
    control,
    shape,
    start_hover,
)
from app.core.kernels import kernel
from app.core.models.copter import ALTITUDE, CLIMB_RATE, SENSED, advance
from app.core.records.trajectory import Samples


@kernel
def step(
    state: State,
    body: Samples,
    p: Packed,
    copter: Samples,
    reference: Samples,
    disturbance: Samples,
) -> None:
    """One step of loop and body. `reference` has shape (4,) as `REFERENCE`, of which the assumed hover throttle is not
    used: it is a parameter of the loop. `disturbance` has shape (3,) as `DISTURBANCES`."""
    state[Z_D], state[V_D], state[A_D] = reference[0], reference[1], reference[2]
    filtered = state[THROTTLE_FILTERED]
    filtered += p[THROTTLE_GAIN] * (state[THROTTLE] - filtered)
    sensed = body[SENSED] + disturbance[2]
    control(state, p, body[ALTITUDE], body[CLIMB_RATE], sensed, filtered <= 0.0, filtered >= 1.0)
    advance(body, copter, p[DT], state[THROTTLE_FILTERED], disturbance[0], disturbance[1])


@kernel
def fly(
    state: State,
    body: Samples,
    p: Packed,
    copter: Samples,
    references: Samples,
    disturbances: Samples,
    flown: Samples,
) -> None:
    """A step per row of `references`, shape (n, 4), and `disturbances`, (n, 3); fills `flown`, (n, 6) as `FLOWN`.

    The loop gives the motors the 2 Hz low-pass of its throttle.
    """
    for row in range(len(references)):
        flown[row, 0] = body[ALTITUDE]
        flown[row, 1] = body[CLIMB_RATE]
        flown[row, 2] = body[SENSED] + disturbances[row, 2]
        step(state, body, p, copter, references[row], disturbances[row])
        flown[row, 3] = state[THROTTLE]
        flown[row, 4] = flown[row, 5] = state[THROTTLE_FILTERED]


@kernel
def shaped(p: Packed, altitude_m: float, targets: Samples, references: Samples) -> None:
    """The reference on its way along `targets`, shape (n,), from rest at an altitude; fills the first three columns of
    `references`, shape (n, 4) as `REFERENCE`: the desired motion at each step. The throttle is never at a limit."""
    state = np.empty(STATE_SIZE)
    start_hover(state, p, 0.0, altitude_m, 0.0, 0.0)
    for row in range(len(targets)):
        shape(state, p, targets[row])
        references[row, 0], references[row, 1], references[row, 2] = state[Z_D], state[V_D], state[A_D]
