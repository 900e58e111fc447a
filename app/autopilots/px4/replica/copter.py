"""The copter under PX4's vertical loop, along a given reference."""

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.replica.vertical import THRUST, Packed, State, rollout
from app.core.kernels import kernel
from app.core.models.copter import ALTITUDE, CLIMB_RATE, SENSED, advance
from app.core.records.trajectory import Samples


@kernel
def fly(
    state: State,
    body: Samples,
    p: Packed,
    copter: Samples,
    dt_s: float,
    slow_gain: float,
    inputs: NDArray[np.float32],
    outputs: NDArray[np.float32],
    references: Samples,
    disturbances: Samples,
    flown: Samples,
) -> None:
    """A step of `dt_s` per row of `references`, shape (n, 4) as `REFERENCE`, and `disturbances`, (n, 3); fills `flown`,
    (n, 6) as `FLOWN`.

    `inputs`, shape (1, 15) as the loop's `INPUTS`, has the conditions and the limits of the whole flight, in single
    precision; set-points and estimates are filled in, and `outputs`, (1, 6), too. `slow_gain` is that of the 2 Hz
    low-pass of the throttle.
    """
    slow = float(state[THRUST])
    for row in range(len(references)):
        flown[row, 0] = body[ALTITUDE]
        flown[row, 1] = body[CLIMB_RATE]
        flown[row, 2] = body[SENSED] + disturbances[row, 2]
        inputs[0, 1], inputs[0, 2] = -body[ALTITUDE], -body[CLIMB_RATE]
        inputs[0, 4], inputs[0, 5], inputs[0, 6] = -references[row, 0], -references[row, 1], -references[row, 2]
        inputs[0, 8] = references[row, 3]
        rollout(state, p, inputs, outputs)
        thrust = float(state[THRUST])
        advance(body, copter, dt_s, thrust, disturbances[row, 0], disturbances[row, 1])
        slow += slow_gain * (thrust - slow)
        flown[row, 3] = flown[row, 4] = thrust
        flown[row, 5] = slow
