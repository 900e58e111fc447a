"""Linear model of an F-16's longitudinal motion, the true system of the paper's first experiment, and its pitch
tracking under the paper's controller.

    ẋ = A·x + B·u,   x = [h ft, Θ rad, V ft/s, α rad, q rad/s],   u = [F_T lb, δ deg]     (the paper's eq. 5)
    F_T = θ1·V + θ2,   δ = θ3·(Θref − Θ) + θ4·α + θ5·q + θ6                              (eq. 6)

All are deviations from trim; the total thrust and elevator are limited. The reference is a sine over the distance
travelled. Control is held over steps of 0.02 s; the transition over a step is exact to the fourth order. This file and
its experiment use the source's units; records use SI.

The F-16 is the low-fidelity model of Russell's 2003 report (Stevens & Lewis data, centre of gravity at 0.30 of the mean
chord), linearised at 15 000 ft and 500 ft/s.
"""

from typing import Final

import numpy as np

from app.core.kernels import kernel
from app.core.records.trajectory import Samples

STEP_S: Final = 0.02
RATE_HZ: Final = 50
AMPLITUDE_RAD: Final = np.deg2rad(10.0)
WAVELENGTH_FT: Final = 10_000.0
AIRSPEED_FT_S: Final = 500.0
LARGEST_ERROR_RAD: Final = 10.0
"""The run ends when the pitch error reaches this size; from there on it counts as this."""

ALTITUDE, PITCH, SPEED, ANGLE_OF_ATTACK, PITCH_RATE, STATES = range(6)
DISTANCE, DIVERGED, MEMORY_SIZE = range(STATES, STATES + 3)
"""Memory of a run: the five states, the distance travelled (ft), and whether the error has reached its limit."""

REFERENCE, THRUST, ELEVATOR, DETAIL = range(STATES, STATES + 4)
"""Columns of a run's detail: the five states, the reference (rad), and the two limited commands."""

TRIM_THRUST_LB: Final = 2120.6214478152
TRIM_ELEVATOR_DEG: Final = -2.4606861723
LOWEST_THRUST_LB: Final = 1000.0 - TRIM_THRUST_LB
HIGHEST_THRUST_LB: Final = 19_000.0 - TRIM_THRUST_LB
LOWEST_ELEVATOR_DEG: Final = -25.0 - TRIM_ELEVATOR_DEG
HIGHEST_ELEVATOR_DEG: Final = 25.0 - TRIM_ELEVATOR_DEG


def transitions(systems: Samples) -> Samples:
    """Discretise over one step with the control held: [A | B] → [Ad | Bd], both of shape (…, 5, 7).

    Ad = Σ_{k≤4}(hA)^k/k!, Bd = h(I + hA/2 + (hA)²/6 + (hA)³/24)B.
    """
    a, b = systems[..., :STATES], systems[..., STATES:]
    one = np.broadcast_to(np.eye(STATES), a.shape)
    held = one + STEP_S * a @ (one / 2.0 + STEP_S * a @ (one / 6.0 + STEP_S * a / 24.0))
    return np.ascontiguousarray(np.concatenate((one + STEP_S * a @ held, STEP_S * held @ b), axis=-1))


@kernel
def rollout(
    memory: Samples,
    gains: Samples,
    transition: Samples,
    amplitude: float,
    bias: Samples,
    errors: Samples,
    detail: Samples,
) -> None:
    """Track the reference of `amplitude` (rad) from `memory` on, for as many steps as `errors` has samples.

    `gains` holds θ1 … θ6; `transition` has shape (5, 7); `bias`, shape (n, 5) or (0, 5), is added to the state after
    each step. Writes the pitch error (rad) at the beginning of every step to `errors`, shape (n,), and the other
    columns to `detail`, shape (n, 8), or nothing if it has shape (0, 8). `memory` then holds the state after the last
    step.
    """
    moved = np.empty(STATES)
    for i in range(len(errors)):
        reference = amplitude * np.sin(2.0 * np.pi * memory[DISTANCE] / WAVELENGTH_FT)
        error = reference - memory[PITCH]
        thrust = gains[0] * memory[SPEED] + gains[1]
        thrust = min(max(thrust, LOWEST_THRUST_LB), HIGHEST_THRUST_LB)
        elevator = gains[2] * error + gains[3] * memory[ANGLE_OF_ATTACK] + gains[4] * memory[PITCH_RATE] + gains[5]
        elevator = min(max(elevator, LOWEST_ELEVATOR_DEG), HIGHEST_ELEVATOR_DEG)
        errors[i] = error
        if len(detail) > 0:
            detail[i, :STATES] = memory[:STATES]
            detail[i, REFERENCE], detail[i, THRUST], detail[i, ELEVATOR] = reference, thrust, elevator
        if abs(error) >= LARGEST_ERROR_RAD:
            memory[DIVERGED] = 1.0
        if memory[DIVERGED] > 0.0:
            continue
        for j in range(STATES):
            total = transition[j, STATES] * thrust + transition[j, STATES + 1] * elevator
            for k in range(STATES):
                total += transition[j, k] * memory[k]
            moved[j] = total + bias[i, j] if len(bias) > 0 else total
        memory[DISTANCE] += STEP_S * (AIRSPEED_FT_S + 0.5 * (memory[SPEED] + moved[SPEED]))
        memory[:STATES] = moved


def track(gains: Samples, transition: Samples, samples: int) -> tuple[Samples, Samples]:
    """One run from trim with all channels: pitch error (n,), detail (n, 8)."""
    errors, detail = np.empty(samples), np.empty((samples, DETAIL))
    rollout(np.zeros(MEMORY_SIZE), gains, transition, AMPLITUDE_RAD, np.empty((0, STATES)), errors, detail)
    return errors, detail


def track_batch(gains: Samples, moves: Samples, samples: int, bias: Samples | None = None) -> Samples:
    """Many runs from trim: gains (k, 6), transitions (k or 1, 5, 7) → pitch errors (k, n)."""
    errors = np.empty((len(gains), samples))
    added = np.empty((0, STATES)) if bias is None else np.ascontiguousarray(bias)
    no_detail = np.empty((0, DETAIL))
    for run, each in enumerate(np.ascontiguousarray(gains)):
        rollout(np.zeros(MEMORY_SIZE), each, moves[run % len(moves)], AMPLITUDE_RAD, added, errors[run], no_detail)
    return errors


A: Final = np.array(
    [
        [0.0, 500.0, 0.0, -500.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
        [1.0799293058609663e-4, -32.17, -1.3277131967150156e-2, -7.3258806559503675, -1.196496421237625],
        [2.0764354658476144e-6, 0.0, -2.5528622616077616e-4, -0.6397628927143547, 0.9378106357725458],
        [0.0, 0.0, 0.0, -1.5679193371965219, -0.8790611636198508],
    ]
)
B: Final = np.array(
    [
        [0.0, 0.0],
        [0.0, 0.0],
        [1.5652406964089213e-3, 7.397043118437943e-2],
        [-2.4447713672664396e-7, -1.3566981876983783e-3],
        [0.0, -0.11365790765411236],
    ]
)
SYSTEM: Final = np.hstack((A, B))
"""[A | B], shape (5, 7)."""
for _matrix in (A, B, SYSTEM):
    _matrix.setflags(write=False)

ELEMENTS: Final = np.nonzero(SYSTEM)
"""Rows and columns of the 19 elements of [A | B] that are not structurally zero."""


def perturbed(perturbation: float, seed: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """[A | B], shape (5, 7), of the inaccurate model: every element times 1 + U(−p, p), drawn for A first, then B."""
    random = np.random.default_rng(seed)
    a = A * (1.0 + random.uniform(-perturbation, perturbation, A.shape))
    b = B * (1.0 + random.uniform(-perturbation, perturbation, B.shape))
    return np.hstack((a, b))
