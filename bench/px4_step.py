"""Computation time of a step of PX4's loop, relative to the same loop in C at -O2.

    ./dev exec python -m bench.px4_step

Needs gcc. Steps the loop through a minute of takeoff, 2 m steps and pushes with noise and new hover estimates; checks
that both results are the same, then times both in turns and prints the best of each and their ratio; exits with 1 if
the ratio is above 1.3.
"""

import ctypes
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.replica import vertical as loop
from app.autopilots.px4.replica.parameters import STEP_S, Parameters
from bench.timing.c_comparison import compiled, is_within_limit

STEPS: Final = 8000
PARAMETERS: Final = Parameters(velocity_d=0.1, velocity_filter_hz=8.0)

Array = NDArray[np.float32]
Run = Callable[[], Array]


def flown() -> Array:
    """Inputs, shape (STEPS, 15): armed at the start, steps of 2 m every 5 s, an altitude that follows them late."""
    time_s, noise = np.arange(STEPS) * STEP_S, np.random.default_rng(1).normal(size=(3, STEPS))
    unknown, on, off = np.full(STEPS, np.nan), np.ones(STEPS), np.zeros(STEPS)
    z = -5.0 + np.cos(2.0 * np.pi * time_s / 10.0) + 0.01 * noise[0]
    vz = -0.2 * np.pi * np.sin(2.0 * np.pi * time_s / 10.0) + 0.02 * noise[1]
    columns = {
        "dt_s": STEP_S * on,
        "z_m": z,
        "vz_m_s": vz,
        "z_derivative_m_s": vz,
        "set_z_m": -4.0 - 2.0 * (np.floor(time_s / 5.0) % 2.0),
        "set_vz_m_s": unknown,
        "set_az_m_s2": np.where(time_s % 20.0 > 15.0, 2.0, np.nan),
        "set_new": on,
        "hover_estimate": np.where(np.arange(STEPS) % 3 == 0, 0.5 + 0.001 * noise[2], np.nan),
        "armed": on,
        "landed": off,
        "ground_contact": off,
        "want_takeoff": on,
        "limit_up_m_s": 3.0 * on,
        "limit_down_m_s": 1.5 * on,
    }
    return np.ascontiguousarray(np.column_stack([columns[name] for name in loop.INPUTS]), dtype=np.float32)


def in_c(library: ctypes.CDLL, inputs: Array) -> Run:
    function = library.rollout
    function.restype = None
    packed, outputs, state = _arrays()
    arrays = [ctypes.c_void_p(array.ctypes.data) for array in (state, packed, inputs, outputs)]

    def run() -> Array:
        loop.start(state, packed)
        function(*arrays[:3], ctypes.c_int64(STEPS), arrays[3])
        return outputs

    return run


def in_python(inputs: Array) -> Run:
    packed, outputs, state = _arrays()

    def run() -> Array:
        loop.start(state, packed)
        loop.rollout(state, packed, inputs, outputs)
        return outputs

    return run


def _arrays() -> tuple[Array, Array, Array]:
    outputs = np.empty((STEPS, len(loop.OUTPUTS)), dtype=np.float32)
    return loop.packed(PARAMETERS), outputs, np.empty(loop.STATE_SIZE, dtype=np.float32)


def main() -> int:
    inputs = flown()
    with compiled(Path(__file__).with_suffix(".c")) as library:
        c, python = in_c(library, inputs), in_python(inputs)
        np.testing.assert_allclose(c(), python(), rtol=0.0, atol=1e-6, err_msg="the outputs differ")
        return 0 if is_within_limit("PX4's loop", c, python, STEPS) else 1


if __name__ == "__main__":
    sys.exit(main())
