"""The toy's loop, a proportional controller, as on board: an example of a replica's kernels."""

import numpy as np

from app.core.kernels import kernel
from app.core.records.trajectory import Samples


@kernel
def rollout(gain: float, target_m: Samples, altitude_m: Samples, throttle: Samples) -> None:
    """Fill the throttle, shape (n,), of every step."""
    for step in range(len(target_m)):
        throttle[step] = min(max(0.5 + gain * (target_m[step] - altitude_m[step]), 0.0), 1.0)


def throttle_of(gain: float, target_m: Samples, altitude_m: Samples) -> Samples:
    """The throttle of every step, shape (n,)."""
    throttle = np.empty(len(target_m))
    rollout(gain, target_m, altitude_m, throttle)
    return throttle
