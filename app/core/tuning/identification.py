"""Identification of an aircraft's linear model from flights that recorded its states and commands.

The unknowns m are the logarithms of factors on the elements of A and B, with a normal prior around the model's own
values from the experiment. Two fits minimise

    Σ (r/σ)² + Σ ((m − m₀)/s)²

by Gauss–Newton with a limited step; the noise σ of each state is re-estimated from the residuals in every iteration:

- `least-squares`: r is the difference between the next recorded state and one model step from the recorded one. Exact
  for clean records; noise on the states biases it, because it enters both sides.
- `map` (maximum a posteriori): r is the difference between the recorded states of a one-second window and the model's,
  driven by the recorded commands from the initial state that fits the window best (linear, so solved exactly). Noise on
  the states affects r alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import Matrix
from app.core.experiments.pitch_tracking import OUTPUT, PitchTracking, states_and_commands
from app.core.models.f16 import LARGEST_ERROR_RAD, PITCH, RATE_HZ, STATES, transitions
from app.core.policy import Vector
from app.core.records.trajectory import Samples

Fit = Literal["least-squares", "map"]
Cube = Samples

WINDOW_STEPS: Final = RATE_HZ
"""One second."""

_ROUNDS: Final = 40
_DIFFERENCE: Final = 1e-5
_LARGEST_STEP: Final = 0.5
_SETTLED: Final = 0.01
"""The fit has converged once a step is below this share of the standard errors, and the noise changes by less."""
_SINGLE_PRECISION: Final = 6e-8
_SMALLEST: Final = 1e-12
_MIN_RECORD: Final = WINDOW_STEPS + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Identified:
    """Result of an identification.

    `model` is the parameter vector, shape (19,), with its `covariance` (19, 19); `noise` is that of each recorded state
    (5,), in the source's units; `flights` are the numbers of the flights used.
    """

    model: Vector
    covariance: Matrix
    noise: Vector
    flights: tuple[int, ...]

    @property
    def pitch_noise_rad(self) -> float:
        return float(self.noise[PITCH])


def identify(experiment: PitchTracking, flights: Sequence[Flight], fit: Fit) -> Identified | None:
    """Fit the model to every flight with recorded states and commands, aborted ones included; None if there is none.

    Pure and deterministic; uses trajectories as they are stored.
    """
    records = [(flight.number, _record(experiment, flight)) for flight in flights]
    usable = [(number, record) for number, record in records if record is not None]
    if not usable:
        return None
    windows = np.concatenate([_windows(record) for _, record in usable])
    residuals = _one_step if fit == "least-squares" else _over_windows
    model, covariance = _fit(experiment, windows, residuals)
    sizes = _rms(windows[..., :STATES]) + _SMALLEST
    noise = _rms(_over_windows(experiment, model[np.newaxis], windows, sizes)[0]) + _SMALLEST
    return Identified(model=model, covariance=covariance, noise=noise, flights=tuple(number for number, _ in usable))


def _record(experiment: PitchTracking, flight: Flight) -> Matrix | None:
    """[x | u] of the flight up to its end or its divergence, shape (n, 7); None if shorter than a window."""
    trajectory = flight.trajectory.as_stored()
    if not len(trajectory):
        return None
    grid_s = experiment.grid_s
    record = states_and_commands(trajectory, grid_s)
    if record is None:
        return None
    flown = grid_s <= trajectory.time_s[-1]
    on_course = np.abs(np.interp(grid_s, trajectory.time_s, trajectory[OUTPUT])) < LARGEST_ERROR_RAD
    length = int(np.logical_and.accumulate(flown & on_course).sum())
    return record[:length] if length >= _MIN_RECORD else None


def _windows(record: Matrix) -> Cube:
    """One-second windows; neighbours share their end samples: (k, 51, 7)."""
    count = (len(record) - 1) // WINDOW_STEPS
    return np.stack([record[k * WINDOW_STEPS : (k + 1) * WINDOW_STEPS + 1] for k in range(count)])


Residuals = Callable[[PitchTracking, Matrix, Cube, Vector], Cube]
"""(experiment, models (p, 19), windows (k, 51, 7), noise (5,)) → (p, …, 5), in the source's units."""


def _one_step(experiment: PitchTracking, models: Matrix, windows: Cube, _noise: Vector) -> Cube:
    moves = transitions(experiment.systems(models))
    predicted = np.einsum("pij,ktj->pkti", moves, windows[:, :-1], optimize=True)
    return np.asarray(windows[np.newaxis, :, 1:, :STATES] - predicted)


def _over_windows(experiment: PitchTracking, models: Matrix, windows: Cube, noise: Vector) -> Cube:
    moves = transitions(experiment.systems(models))
    free, forced = _responses(moves, windows)
    beyond = (windows[..., :STATES] - forced) / noise
    weighted = (free / noise[:, np.newaxis]).reshape(len(models), -1, STATES)
    basis = np.linalg.qr(weighted)[0]
    flat = beyond.reshape(len(models), len(windows), -1)
    left = flat - (flat @ basis) @ basis.transpose(0, 2, 1)
    return np.asarray(left.reshape(beyond.shape) * noise)


def _responses(moves: Cube, windows: Cube) -> tuple[Cube, Cube]:
    """Free response to each initial state (p, 51, 5, 5), and response to the commands from rest (p, k, 51, 5)."""
    models, steps = len(moves), windows.shape[1]
    free = np.empty((models, steps, STATES, STATES))
    forced = np.zeros((models, len(windows), steps, STATES))
    free[:, 0] = np.eye(STATES)
    motion, control = moves[..., :STATES], moves[..., STATES:].transpose(0, 2, 1)
    turned = motion.transpose(0, 2, 1)
    for i in range(1, steps):
        free[:, i] = motion @ free[:, i - 1]
        forced[:, :, i] = forced[:, :, i - 1] @ turned + windows[np.newaxis, :, i - 1, STATES:] @ control
    return free, forced


def _rms(values: Cube) -> Vector:
    """Root mean square over all but the last axis."""
    return np.asarray(np.sqrt((values.reshape(-1, STATES) ** 2).mean(axis=0)))


def _fit(experiment: PitchTracking, windows: Cube, residuals: Residuals) -> tuple[Vector, Matrix]:
    """Gauss–Newton from the model's own parameters; the noise follows the residuals down to the storage precision."""
    nominal = experiment.nominal_model
    precision = 1.0 / experiment.prior_sd**2
    floor = _SINGLE_PRECISION * np.abs(windows[..., :STATES]).max(axis=(0, 1)) + _SMALLEST
    model = nominal
    noise = np.maximum(_rms(residuals(experiment, model[np.newaxis], windows, floor)[0]), floor)
    covariance = np.diag(1.0 / precision)
    for _ in range(_ROUNDS):
        shifted = model + _DIFFERENCE * np.vstack((np.zeros_like(model), np.eye(len(model))))
        left = residuals(experiment, shifted, windows, noise).reshape(len(shifted), -1, STATES) / noise
        now, *others = left.reshape(len(shifted), -1)
        slopes = (np.stack(others) - now) / _DIFFERENCE
        # einsum: a matrix product of this shape would wake every linear algebra thread for a millisecond's work
        covariance = np.linalg.inv(np.einsum("ik,jk->ij", slopes, slopes) + np.diag(precision))
        step = -covariance @ (slopes @ now + precision * (model - nominal))
        step *= min(1.0, _LARGEST_STEP / float(np.abs(step).max()))
        model = np.clip(model + step, *experiment.limits)
        before = noise
        noise = np.maximum(_rms(residuals(experiment, model[np.newaxis], windows, noise)[0]), floor)
        moved = np.abs(step) / np.sqrt(np.diag(covariance))
        if moved.max() < _SETTLED and np.abs(noise / before - 1.0).max() < _SETTLED:
            break
    return model, covariance
