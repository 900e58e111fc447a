"""Paparazzi's rotorcraft vertical guidance of mid-2015, replicated integer for integer, and the replay of a recorded
run through it.

The loop runs at 512 Hz. z points down; fractions are binary: positions 8 bits, speeds 19, accelerations 10, the cosine
of the tilt (r33) 14. Every operation is 32-bit two's complement and wraps, identically in compiled and interpreted
code; only the reference altitude is 64-bit. `step` is the kernel, on a state array that its caller owns.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.kernels import kernel

INT32_MIN: Final = -(2**31)
INT32_MAX: Final = 2**31 - 1


@kernel
def wrap32(value: int) -> int:
    """The 32-bit two's-complement integer with the same low 32 bits."""
    return ((value + 0x80000000) & 0xFFFFFFFF) - 0x80000000


@kernel
def divide(dividend: int, divisor: int) -> int:
    """Quotient truncated toward zero, as in C.

    Exact for 32-bit operands, because a double resolves their quotients (two different ones differ by at least 2⁻³¹ of
    their size, a double resolves 2⁻⁵³).
    """
    return int(dividend / divisor)


@kernel
def limit(value: int, low: int, high: int) -> int:
    """`value` limited to `low` … `high`."""
    return low if value < low else min(value, high)


def fix(value: float, fraction_bits: int) -> int:
    """`value`·2ⁿ truncated toward zero, as the firmware converts constants. Called on import, so not for kernels."""
    return int(value * (1 << fraction_bits))


@kernel
def measured(value: float, fraction_bits: int) -> int:
    """`value`·2ⁿ rounded to the nearest integer: converts a continuous quantity for the loop without a bias."""
    return math.floor(value * (1 << fraction_bits) + 0.5)


RATE_HZ: Final = 512
STEP_S: Final = 1 / RATE_HZ
FULL_THRUST: Final = 9600
POSITION_BITS: Final = 8
SPEED_BITS: Final = 19
R33_BITS: Final = 14
LEVEL: Final = 1 << R33_BITS

THROTTLE, ALT, CLIMB = range(3)
MODES: Final = {"throttle": THROTTLE, "alt": ALT, "climb": CLIMB}
"""`throttle`: target is the thrust; `alt`: altitude up, 8 bits; `climb`: climb rate up, 19 bits."""

# The AR.Drone 2 airframe; nominal hover throttle fixed, without adaptation (the paper's footnote 5).
NOMINAL_HOVER_THROTTLE: Final = 0.655
_GRAVITY: Final = 9.81
_OMEGA: Final = float(np.deg2rad(100.0))
_ZETA: Final = 0.85

_ZETA_OMEGA: Final = fix(_ZETA * _OMEGA, 10)
_OMEGA_2: Final = fix(_OMEGA**2, 7)
_SPEED_MIN: Final = fix(-3.0, 17)
_SPEED_MAX: Final = fix(3.0, 17)
_ACCELERATION_MIN: Final = fix(-2.0 * _GRAVITY, 8)
_ACCELERATION_MAX: Final = fix(0.8 * _GRAVITY, 8)
_TAU_INVERSE: Final = fix(4.0, 16)
_WEIGHT: Final = fix(_GRAVITY, 18)
_INVERSE_MASS: Final = fix(_GRAVITY / (float(np.float32(NOMINAL_HOVER_THROTTLE)) * FULL_THRUST), 18)
_CLIMB_LEASH: Final = fix(2.0, 26)
_R33_MIN: Final = fix(30.0 * np.pi / 180.0, R33_BITS)  # an angle as limit of a cosine, as in the firmware
_FEED_FORWARD_MAX: Final = 8640

POSITION_ERROR_MAX: Final = fix(10.0, POSITION_BITS)
SPEED_ERROR_MAX: Final = fix(10.0, SPEED_BITS)
ERROR_SUM_MAX: Final = 2_000_000

(
    P, V, A, Z_SUM_ERR, Z_REF, ZD_REF, ZDD_REF, FF_CMD, FB_CMD, LARGEST_PRODUCT, CHECK_PHASE, CHECKS_PASSED, STATE_SIZE,
) = range(13)  # fmt: skip
"""Indices in the state array."""

State = NDArray[np.int64]

_CHECK_RATE_HZ: Final = 20
_CHECKS_NEEDED: Final = 20
_CHECK_THRUST: Final = 500


@kernel
def start(state: State, z: int, zd: int) -> None:
    """Enter the loop at position `z` and speed `zd`; the state array, shape (STATE_SIZE,), is overwritten."""
    state[:] = 0
    state[P] = z << 18
    state[V] = zd >> 2


def new_state(z: int, zd: int) -> State:
    """State of a loop that is entered at position `z` and speed `zd`, for callers in Python."""
    state = np.zeros(STATE_SIZE, dtype=np.int64)
    start(state, z, zd)
    return state


@kernel
def detect_flight(state: State, thrust: int) -> bool:
    """Whether the vehicle counts as flying; call once before each step, with the thrust of the previous step.

    Latches once the thrust has been above 500 in 20 consecutive checks made at 20 Hz.
    """
    if state[CHECKS_PASSED] < _CHECKS_NEEDED:
        if state[CHECK_PHASE] >= RATE_HZ:
            state[CHECK_PHASE] -= RATE_HZ
            state[CHECKS_PASSED] = state[CHECKS_PASSED] + 1 if thrust > _CHECK_THRUST else 0
        state[CHECK_PHASE] += _CHECK_RATE_HZ
    return bool(state[CHECKS_PASSED] >= _CHECKS_NEEDED)


@kernel
def _advance_reference(state: State, mode: int, target: int, z: int) -> None:
    """The second-order reference (`alt`) or the first-order one in speed (`climb`), within its limits."""
    p = state[P] + state[V]
    v = wrap32(state[V] + state[A])
    if mode == ALT:
        e = wrap32(-target - (p >> 18))
        a = wrap32((wrap32(-2 * _ZETA_OMEGA * (v >> 9)) >> 10) + (wrap32(_OMEGA_2 * e) >> 7))
    else:
        p = limit(p, (z << 18) - _CLIMB_LEASH, (z << 18) + _CLIMB_LEASH)
        e = wrap32(v - (-target >> 2))
        a = wrap32(-_TAU_INVERSE * (e >> 9)) >> 16
    a = limit(a, _ACCELERATION_MIN, _ACCELERATION_MAX)
    if v <= _SPEED_MIN:
        v, a = _SPEED_MIN, max(a, 0)
    elif v >= _SPEED_MAX:
        v, a = _SPEED_MAX, min(a, 0)
    state[P], state[V], state[A] = p, v, a
    state[Z_REF], state[ZD_REF], state[ZDD_REF] = wrap32(p >> 18), v << 2, a << 2


@kernel
def feed_forward(zdd_ref: int, r33: int) -> int:
    """Thrust for the reference acceleration at this tilt, 0 … 8640."""
    force = divide(wrap32(_WEIGHT - wrap32(zdd_ref << 8)), _INVERSE_MASS)
    return limit(divide(wrap32(force << R33_BITS), max(r33, _R33_MIN)), 0, _FEED_FORWARD_MAX)


@kernel
def _feedback(state: State, kp: int, ki: int, kd: int, ez: int, ev: int) -> int:
    """PID on limited errors; each product wraps at 32 bits, and the largest one before wrapping is stored."""
    proportional = -kp * ez
    damping = -kd * ev
    integral = -ki * state[Z_SUM_ERR]
    state[LARGEST_PRODUCT] = max(state[LARGEST_PRODUCT], abs(proportional), abs(damping), abs(integral))
    return wrap32((wrap32(proportional) >> 7) + (wrap32(damping) >> 16) + (wrap32(integral) >> 16))


@kernel
def step(
    state: State, mode: int, target: int, kp: int, ki: int, kd: int, z: int, zd: int, r33: int, in_flight: bool
) -> int:
    """Take one step of 1/512 s and return the thrust command, 0 … 9600. All inputs are 32-bit integers."""
    if mode == THROTTLE:
        state[P], state[V], state[A], state[Z_SUM_ERR] = z << 18, zd >> 2, 0, 0
        state[Z_REF], state[ZD_REF], state[ZDD_REF] = z, zd, 0
        return target
    _advance_reference(state, mode, target, z)
    ez = limit(wrap32(state[Z_REF] - z), -POSITION_ERROR_MAX, POSITION_ERROR_MAX)
    ev = limit(wrap32(state[ZD_REF] - zd), -SPEED_ERROR_MAX, SPEED_ERROR_MAX)
    state[Z_SUM_ERR] = limit(state[Z_SUM_ERR] + ez, -ERROR_SUM_MAX, ERROR_SUM_MAX) if in_flight else 0
    state[FF_CMD] = feed_forward(state[ZDD_REF], r33)
    state[FB_CMD] = _feedback(state, kp, ki, kd, ez, ev)
    return limit(wrap32(state[FF_CMD] + state[FB_CMD]), 0, FULL_THRUST)


INPUTS: Final = ("mode", "target", "kp", "ki", "kd", "z", "zd", "r33", "in_flight")
OUTPUTS: Final = ("z_ref", "zd_ref", "zdd_ref", "z_sum_err", "ff_cmd", "fb_cmd", "thrust")
_IN_STATE: Final = [Z_REF, ZD_REF, ZDD_REF, Z_SUM_ERR, FF_CMD, FB_CMD]
"""Places of all outputs but the thrust in the state array."""


@dataclass(frozen=True, slots=True)
class LoopTrace:
    """Recorded inputs and outputs of the loop, one row per step, all 32-bit integers.

    `inputs` has shape (n, 9) in the order of `INPUTS`, modes as in `MODES`; `outputs` has shape (n, 7) in
    the order of `OUTPUTS`; n ≥ 1.
    """

    inputs: NDArray[np.int64]
    outputs: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.inputs)


def replayed(trace: LoopTrace) -> NDArray[np.int64]:
    """The replica's own outputs, shape (n, 7), started at the first row's z and zd and stepped once per row."""
    computed, rows = np.empty_like(trace.outputs), trace.inputs.tolist()
    state = new_state(rows[0][INPUTS.index("z")], rows[0][INPUTS.index("zd")])
    for row, (mode, target, kp, ki, kd, z, zd, r33, in_flight) in enumerate(rows):
        computed[row, -1] = step(state, mode, target, kp, ki, kd, z, zd, r33, bool(in_flight))
        computed[row, :-1] = state[_IN_STATE]
    return computed
