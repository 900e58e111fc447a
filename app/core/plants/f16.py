"""Longitudinal model of an F-16, the true system of the paper's first experiment.

Low-fidelity model of Russell's 2003 report (Stevens & Lewis data, centre of gravity at 0.30 of the mean chord),
linearised at 15 000 ft and 500 ft/s. States and inputs as in `app.core.plants.pitch`.
"""

from typing import Final

import numpy as np

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
