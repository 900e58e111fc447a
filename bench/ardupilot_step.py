"""Computation time of a step of ArduCopter's loop, relative to the same loop in C at -O2.

    ./dev exec python -m bench.ardupilot_step

Needs gcc. Steps the loop through 20 s of 2 m steps with noise and gusts, with every term of the controllers in use;
checks that both results agree to 1e-9, then times both in turns and prints the best of each and their ratio; exits with
1 if the ratio is above 1.3.
"""

import ctypes
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.ardupilot.replica import vertical as loop
from app.autopilots.ardupilot.replica.parameters import STEP_S, Parameters
from bench.timing.c_comparison import compiled, is_within_limit

STEPS: Final = 8000
HOVER: Final = (0.39, 6.0, 0.0, 0.0)
PARAMETERS: Final = Parameters(
    position_p_1_s=2.2,
    velocity_p_1_s=7.0,
    velocity_i_1_s2=0.3,
    velocity_d=0.05,
    velocity_ff_1_s=0.02,
    acceleration_p=1.1,
    acceleration_i_1_s=2.4,
    acceleration_d_s=0.02,
    acceleration_ff=0.05,
    acceleration_d_ff_s=0.001,
    acceleration_target_filter_hz=10.0,
    acceleration_derivative_filter_hz=15.0,
    acceleration_m_s2=2.5,
    jerk_m_s3=12.0,
    hover_throttle=0.39,
)

Array = NDArray[np.float64]
Run = Callable[[], Array]


def flown() -> Array:
    """Inputs, shape (STEPS, 6): steps of 2 m every 5 s, an altitude that follows them late, noise, throttle limits."""
    time_s, noise = np.arange(STEPS) * STEP_S, np.random.default_rng(1).normal(size=(3, STEPS))
    target = 6.0 + 2.0 * (np.floor(time_s / 5.0) % 2.0)
    late = 7.0 - np.cos(2.0 * np.pi * time_s / 10.0)
    v = 0.2 * np.pi * np.sin(2.0 * np.pi * time_s / 10.0) + 0.02 * noise[1]
    limits = [(time_s % 5.0 < 0.2) & (target == low) for low in (6.0, 8.0)]
    return np.ascontiguousarray(
        np.column_stack([target, late + 0.01 * noise[0], v, noise[2], *limits]), dtype=np.float64
    )


def in_c(library: ctypes.CDLL, inputs: Array) -> Run:
    function = library.rollout
    function.restype = None
    packed, outputs, state = loop.packed(PARAMETERS), np.empty((STEPS, len(loop.OUTPUTS))), np.empty(loop.STATE_SIZE)
    arrays = [ctypes.c_void_p(array.ctypes.data) for array in (state, packed, inputs, outputs)]

    def run() -> Array:
        loop.start_hover(state, packed, *HOVER)
        function(*arrays[:3], ctypes.c_int64(STEPS), arrays[3])
        return outputs

    return run


def in_python(inputs: Array) -> Run:
    packed, outputs, state = loop.packed(PARAMETERS), np.empty((STEPS, len(loop.OUTPUTS))), np.empty(loop.STATE_SIZE)
    followed = np.zeros(STEPS, dtype=np.bool_)

    def run() -> Array:
        loop.start_hover(state, packed, *HOVER)
        loop.rollout(state, packed, inputs, outputs, followed, outputs)
        return outputs

    return run


def main() -> int:
    inputs = flown()
    with compiled(Path(__file__).with_suffix(".c")) as library:
        c, python = in_c(library, inputs), in_python(inputs)
        assert np.abs(c() - python()).max() < 1e-9, "the outputs differ"
        return 0 if is_within_limit("ArduCopter's loop", c, python, STEPS) else 1


if __name__ == "__main__":
    sys.exit(main())
